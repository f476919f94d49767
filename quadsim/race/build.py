"""From a Spec to a flight: build plant, controller and referee, then simulate."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from quadsim.physics.plant import Plant
from quadsim.race.clock import CLOCKS
from quadsim.race.events import Frame
from quadsim.race.flight import Controller, PlainController, RefereeProtocol, simulate
from quadsim.race.own_parts import made
from quadsim.race.settings import SettingError
from quadsim.race.spec import Spec

if TYPE_CHECKING:
    from controllers.mppi import MPPI


def with_threads(spec: Spec) -> Spec:
    """Use the spec's number of CPU threads from now on (None: all) and note it in the spec. Raises SettingError."""
    from controllers.rollout.threads import use_threads  # which loads the compiler

    try:
        spec.host["threads"] = use_threads(spec.host["threads"])
    except ValueError as error:  # "threads: expected ..."
        raise SettingError(*str(error).split(": ", 1)) from None
    return spec


def build(spec: Spec) -> tuple[Plant, Controller, RefereeProtocol]:
    """The plant, the controller and the referee of one flight. The caller closes the plant.

    Raises ValueError where course, laps and vehicle do not fit together.
    """
    own, streams = spec.own, spec.streams
    referee = made(own.referee, spec) or spec.entry.referee(spec)
    controller = made(own.controller, spec) or planner_of(spec, streams[0])
    if not hasattr(controller, "rest"):
        controller = PlainController(controller, spec.entry.system(spec.model, spec.planner.mppi.dt).rest)
    return made(own.plant, spec) or spec.entry.plant(spec, streams), controller, referee


def planner_of(spec: Spec, stream: np.random.SeedSequence) -> MPPI:
    """The planner alone; `stream` seeds its perturbations."""
    from controllers.adaptation import Adaptation
    from controllers.mppi import MPPI  # here: they load the compiler

    mppi = spec.planner.mppi
    own: Any = spec.own.cost
    cost: Any = spec.entry.cost(spec)
    if own is not None:
        cost = own(cost) if callable(own) else own
    adaptation = Adaptation(spec.model, mppi.dt) if mppi.adapt and spec.system == "quadrotor" else None
    system = spec.entry.system(spec.model, mppi.dt)
    return MPPI(system, cost, spec.planner.sampling, mppi, stream, adaptation)


def launch(spec: Spec, plant: Plant, controller: Any, referee: RefereeProtocol) -> Iterator[Frame]:
    """The frames of a flight, of the parts that `build` returned."""
    from controllers.deadline import Deadline
    from controllers.mppi import MPPI
    from controllers.sampled_trajectories import take_snapshot

    timed = Deadline(controller, spec.deadline_ms) if spec.deadline_ms else controller
    snapshot = partial(take_snapshot, controller) if isinstance(controller, MPPI) else None
    return simulate(plant, timed, referee, spec.planner.mppi.dt, CLOCKS[spec.clock](), snapshot)


def flight_frames(spec: Spec) -> Iterator[Frame]:
    """Build and simulate: one Frame for each control step, the last one with the outcome."""
    plant, controller, referee = build(spec)
    with closing(plant):
        yield from launch(spec, plant, controller, referee)
