"""Build the parts of a Spec's flight, and simulate it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, cast

from numpy.random import SeedSequence

from quadsim.config.build_cost import check_cost, cost_on
from quadsim.config.build_navigation import navigation_of
from quadsim.config.build_plant import plant_of, system_of
from quadsim.config.changes import planner_after
from quadsim.config.own import OwnController, OwnReferee, made
from quadsim.config.settings import SETTINGS, SettingError
from quadsim.config.spec import Spec
from quadsim.controllers.excitation import Excitation
from quadsim.controllers.in_flight import Change, PlannerInFlight
from quadsim.controllers.learned.pilot import PilotController
from quadsim.controllers.presets import Planner
from quadsim.files.values import checked
from quadsim.physics.faults import CommandFault
from quadsim.physics.link import FaultyCommands
from quadsim.physics.plant import Arena
from quadsim.racing.clock import CLOCKS
from quadsim.racing.events import Frame
from quadsim.racing.flight import (
    Controller,
    FlightParts,
    RefereeProtocol,
    rest_of,
    simulate,
)
from quadsim.racing.referee import Referee

if TYPE_CHECKING:
    from quadsim.controllers.mppi import MPPI


def with_threads(spec: Spec) -> Spec:
    """Use the spec's number of CPU threads from now on, and return the spec with this number.

    Raises:
        SettingError: the number is less than 1, or more than this machine has.
    """
    from quadsim.controllers.lanes.threads import use_threads  # here: it loads the compiler

    return spec.on_threads(use_threads(spec.threads))


def use_threads_of(given: object) -> None:
    """Use this number of CPU threads from now on; None does not change the number.

    Raises:
        SettingError: the number is less than 1, or more than this machine has.
    """
    if given is None:
        return
    from quadsim.controllers.lanes.threads import use_threads  # here: it loads the compiler

    use_threads(cast(int, checked("threads", given, SETTINGS["threads"].kind)))


def build(
    spec: Spec, arena: Arena | None = None, referee: RefereeProtocol | None = None
) -> FlightParts:
    """Return the parts of one flight for `simulate`. The caller closes the plant.

    Args:
        spec: specification of the flight.
        arena: world that the vehicle shares with others; None: the vehicle's own world.
        referee: referee of the flight; None: the spec's referee.

    Raises:
        SettingError: one of the user's own objects does not fit its role (a ValueError).
        ValueError: course, laps and vehicle do not fit together.
    """
    from quadsim.controllers.mppi import MPPI  # here: it loads the compiler

    referee = referee or referee_of(spec)
    controller = controller_of(spec)
    snapshot = None
    if isinstance(controller, MPPI):
        controller = in_flight(spec, controller)
        snapshot = controller.snapshot
    plant = plant_of(spec, arena)
    faults = [fault for fault in spec.drawn_faults if isinstance(fault, CommandFault)]
    return FlightParts(
        plant=plant,
        controller=controller,
        referee=referee,
        period=spec.planner.mppi.dt,
        navigation=navigation_of(spec, plant, referee, rest_of(controller)),
        clock=CLOCKS[spec.clock](),
        snapshot=snapshot,
        faulty_commands=FaultyCommands(faults) if faults else None,
        # The racing referee has this limit of its own.
        time_limit=None if spec.referee is None else spec.timeout,
    )


def controller_of(spec: Spec) -> Controller:
    """Return the controller of a flight: the user's own, manoeuvres, a pilot, or the planner.

    Raises:
        SettingError: the user's controller has no control at rest of 4 numbers, or has a deadline
            that only planners support.
    """
    from quadsim.controllers.mppi import MPPI  # here: it loads the compiler

    if spec.controller is None:
        if spec.excite:
            return Excitation(spec.vehicle, spec.course)
        return pilot_of(spec) or planner_of(spec)
    own = made("controller", spec.controller, spec)
    if isinstance(own, MPPI):
        return own
    if spec.deadline_ms is not None:
        wanted = f"expected none for {type(own).__name__}, as only MPPI keeps it by its samples"
        raise SettingError("deadline_ms", f"{wanted}, got {spec.deadline_ms:g}")
    return OwnController(own, system_of(spec).rest)


def referee_of(spec: Spec) -> RefereeProtocol:
    """Return the referee of one flight: the user's own, or the racing referee.

    Raises:
        SettingError: the user's referee lacks the counts or the outcome.
        ValueError: course, laps and vehicle do not fit together.
    """
    if spec.referee is not None:
        return OwnReferee(made("referee", spec.referee, spec))
    return racing_referee(spec)


def racing_referee(spec: Spec, stuck_after: float | None = None) -> Referee:
    """Return the racing referee of one flight, alone, in a race of several, or by a client.

    Args:
        spec: specification of the flight.
        stuck_after: time without progress after which the vehicle is stuck [s]; None: that of the
            spec.

    Raises:
        ValueError: course, laps and vehicle do not fit together.
    """
    return Referee(
        spec.flown_course,
        spec.vehicle.radius,
        laps=spec.laps,
        timeout=spec.timeout,
        penalties=spec.penalties,
        stuck_after=spec.stuck_after if stuck_after is None else stuck_after,
    )


def pilot_of(spec: Spec) -> PilotController | None:
    """Return the learned pilot that flies instead of the planner, None if there is none."""
    if spec.pilot is None:
        return None
    actions = spec.pilot.about.actions
    return PilotController(spec.pilot, actions, spec.course, spec.laps, system_of(spec).rest)


def planner_of(spec: Spec, stream: SeedSequence | None = None) -> MPPI:
    """Return the planner of a flight, without the other parts.

    Args:
        spec: specification of the flight.
        stream: seed of the planner's perturbations; None: the flight's seed.

    Raises:
        SettingError: the user's term or cost cannot be compiled.
    """
    from quadsim.controllers.mppi import MPPI  # here: it loads the compiler

    if stream is None:
        stream = spec.streams.planner
    cost = cost_on(spec, spec.course)
    if spec.terms or spec.cost is not None:
        check_cost(spec, cost)
    sampling = spec.planner.sampling
    return MPPI(system_of(spec), cost, sampling, spec.planner.mppi, stream, partial(cost_on, spec))


def in_flight(spec: Spec, planner: MPPI) -> PlannerInFlight:
    """Return the planner of a flight with the changes and the deadline of the spec."""

    def make(numbers: Planner) -> MPPI:
        return planner_of(replace(spec, planner=numbers))

    changes = [Change(change.t, partial(planner_after, change)) for change in spec.changes]
    return PlannerInFlight(planner, spec.planner, make, changes, spec.deadline_ms)


def flight_frames(spec: Spec) -> Iterator[Frame]:
    """Build and simulate a flight, and yield its Frames; the last one has the outcome."""
    parts = build(spec)
    with closing(parts.plant):
        yield from simulate(parts)
