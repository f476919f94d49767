"""From a Spec to a flight: build plant, controller and referee, then simulate."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from controllers.learned.pilot import PilotController
from quadsim.physics.plant import NamedPlant, Plant
from quadsim.race.clock import CLOCKS
from quadsim.race.events import Frame
from quadsim.race.flight import Controller, PlainController, RefereeProtocol, simulate
from quadsim.race.navigation import ExactState, Navigation, SensedState
from quadsim.race.own_parts import made
from quadsim.race.settings import SettingError
from quadsim.race.spec import Spec
from quadsim.sensing.estimation.estimator import Estimator
from quadsim.sensing.estimation.prediction import Commands
from quadsim.sensing.estimation.vehicle_model import VehicleModel
from quadsim.sensing.sensors import WARM_UP, Sensors
from quadsim.streams import Streams

if TYPE_CHECKING:
    from controllers.costs import Cost
    from controllers.mppi import MPPI

LEAST_ROTOR_STD = 0.05  # [m/s^2] of the thrust by rotor speeds


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
    controller = made(own.controller, spec) or pilot_of(spec) or planner_of(spec, streams.planner)
    if not hasattr(controller, "rest"):
        controller = PlainController(controller, spec.entry.system(spec.model, spec.planner.mppi.dt).rest)
    return plant_of(spec, streams), controller, referee


def plant_of(spec: Spec, streams: Streams) -> Plant:
    """Return the plant of one flight: the user's own, or that of the system. The caller closes it."""
    own = made(spec.own.plant, spec)
    if own is None:
        return spec.entry.plant(spec, streams)
    if spec.system == "quadrotor" and not spec.own.system:
        return NamedPlant(own)
    return own


def pilot_of(spec: Spec) -> PilotController | None:
    """The learned pilot, where one flies in the planner's place."""
    if spec.pilot is None:
        return None
    rest = spec.entry.system(spec.model, spec.planner.mppi.dt).rest
    return PilotController(spec.pilot, spec.course, spec.laps, rest)


def planner_of(spec: Spec, stream: np.random.SeedSequence) -> MPPI:
    """The planner alone; `stream` seeds its perturbations."""
    from controllers.adaptation import Adaptation
    from controllers.mppi import MPPI  # here: they load the compiler

    mppi = spec.planner.mppi
    cost = _cost(spec, spec.course)
    if spec.own.terms or spec.own.cost:
        _check_cost(spec, cost)
    adaptation = Adaptation(spec.model, mppi.dt) if mppi.adapt and spec.system == "quadrotor" else None
    system = spec.entry.system(spec.model, mppi.dt)
    return MPPI(system, cost, spec.planner.sampling, mppi, stream, adaptation)


def _check_cost(spec: Spec, cost: Cost) -> None:
    """Raise SettingError, of one line, where a term of the user's own cannot be compiled."""
    from controllers.rollout.planner_loops import module_source
    from controllers.rollout.trace import TraceError

    try:
        module_source(spec.entry.system(spec.model, spec.planner.mppi.dt), cost, np.float32)
    except TraceError as error:
        raise SettingError("terms" if spec.own.terms else "cost", str(error)) from None


def _cost(spec: Spec, course: Any) -> Any:
    """Of this course, by the spec's own function where it has one."""
    own: Any = spec.own.cost
    if own is not None and not callable(own):
        return spec.own.with_terms(own)
    cost = spec.entry.cost(replace(spec, course=course))
    return spec.own.with_terms(cost if own is None else own(cost))


def launch(spec: Spec, plant: Plant, controller: Any, referee: RefereeProtocol) -> Iterator[Frame]:
    """The frames of a flight, of the parts that `build` returned."""
    from controllers.deadline import Deadline
    from controllers.mppi import MPPI
    from controllers.sampled_trajectories import take_snapshot

    timed = Deadline(controller, spec.deadline_ms) if spec.deadline_ms else controller
    snapshot = partial(take_snapshot, controller) if isinstance(controller, MPPI) else None
    clock = CLOCKS[spec.clock]()
    return simulate(
        plant, timed, referee, spec.planner.mppi.dt, clock, snapshot, navigation_of(spec, plant, controller)
    )


def navigation_of(spec: Spec, plant: Plant, controller: Any) -> Navigation | None:
    """What tells the controller its state; None where that is the true one and commands act at once.

    A planner that adapts is told by it what is known of the vehicle, and where gates stand.
    """
    if spec.system != "quadrotor" or spec.own.system:
        return None
    if spec.sensing is None and not spec.vehicle.latency and spec.clock != "wall":
        return None
    adaptation = getattr(controller, "adaptation", None)
    known = _sensed(spec, plant, adaptation is not None) if spec.sensing else None
    knowledge = known or ExactState(spec.model, adaptation, spec.planner.mppi.dt)
    knowledge.watch(plant.state)
    commands = Commands(tuple(controller.rest.tolist()), spec.vehicle.latency)
    remap = getattr(controller, "set_cost", None) and (lambda course: controller.set_cost(_cost(spec, course)))
    navigation = Navigation(knowledge, commands, spec.course, spec.laps, spec.planner.mppi.dt, remap)
    if adaptation is not None:
        controller.adaptation = navigation
    return navigation


def _sensed(spec: Spec, plant: Plant, adapt: bool) -> SensedState:
    sensing, dt, gates = spec.sensing, spec.planner.mppi.dt, tuple(dict.fromkeys(spec.course.gates))
    assert sensing
    assert sensing.imu
    true_gates = tuple(dict.fromkeys(spec.flown_course.gates))
    lag = getattr(plant, "velocity_lag", 0.0)
    sensors = Sensors(sensing, spec.streams.sensors, spec.vehicle, true_gates, lag, spec.flown_course.obstacles)
    sensors.warm_up(plant.state, plant.dt)
    estimator = Estimator(sensing, gates, spec.course.start, -WARM_UP, spec.displace_gates)
    vehicle, rotors = VehicleModel(spec.model, dt, sensing.imu), spec.vehicle.rotors
    std = LEAST_ROTOR_STD
    if sensing.rotors and rotors:  # four independent rotors at full speed
        c2, c1, _ = rotors.thrust_map
        std = max(std, 2 * sensing.rotors.noise * (2 * c2 * rotors.omega_max + c1) / spec.vehicle.mass)
    return SensedState(sensors, estimator, vehicle, dt, adapt, std)


def flight_frames(spec: Spec) -> Iterator[Frame]:
    """Build and simulate: one Frame for each control step, the last one with the outcome."""
    plant, controller, referee = build(spec)
    with closing(plant):
        yield from launch(spec, plant, controller, referee)
