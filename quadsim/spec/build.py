"""From a Spec to a flight: build plant, controller and referee, then simulate."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from controllers.learned.pilot import PilotController
from quadsim.course import Gate
from quadsim.physics.plant import NamedPlant, Plant
from quadsim.race.clock import CLOCKS
from quadsim.race.events import Frame
from quadsim.race.flight import (
    Controller,
    PlainController,
    RefereeProtocol,
    exact_navigation,
    simulate,
)
from quadsim.sensing.config import RotorConfig
from quadsim.sensing.estimation.body_rates import BodyRates
from quadsim.sensing.estimation.estimator import Estimator
from quadsim.sensing.estimation.prediction import Commands, GateCounter
from quadsim.sensing.estimation.vehicle_learner import VehicleLearner
from quadsim.sensing.navigation import (
    CourseEstimate,
    Navigation,
    RefereeCount,
    SensedState,
    TrueState,
)
from quadsim.sensing.sensors import WARM_UP, Sensors
from quadsim.spec.own_parts import made
from quadsim.spec.settings import SettingError
from quadsim.spec.spec import Spec
from quadsim.streams import Streams
from quadsim.vehicle import Vehicle

if TYPE_CHECKING:
    from controllers.costs import Cost
    from controllers.mppi import MPPI

LEAST_ROTOR_STD = 0.05  # [m/s^2] of the thrust by rotor speeds


def with_threads(spec: Spec) -> Spec:
    """Use the spec's number of CPU threads from now on (None: all) and note it in the spec. Raises
    SettingError."""
    from controllers.lanes.threads import use_threads  # which loads the compiler

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
    if not isinstance(controller, Controller):
        controller = PlainController(
            controller, spec.entry.system(spec.model, spec.planner.mppi.dt).rest
        )
    return plant_of(spec, streams), controller, referee


def plant_of(spec: Spec, streams: Streams) -> Plant:
    """Return the plant of one flight: the user's own, or that of the system. The caller closes
    it."""
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
    from controllers.mppi import MPPI  # here: it loads the compiler

    mppi = spec.planner.mppi
    if spec.own.terms or spec.own.cost:
        check_cost(spec, cost_on(spec, spec.course))
    system = spec.entry.system(spec.model, mppi.dt)
    cost_of = partial(cost_on, spec)
    return MPPI(system, cost_of(spec.course), spec.planner.sampling, mppi, stream, cost_of)


def check_cost(spec: Spec, cost: Cost) -> None:
    """Raise SettingError, of one line, where a term of the user's own cannot be compiled."""
    from controllers.lanes.planner_loops import module_source
    from controllers.lanes.trace import TraceError

    try:
        module_source(spec.entry.system(spec.model, spec.planner.mppi.dt), cost, np.float32)
    except TraceError as error:
        raise SettingError("terms" if spec.own.terms else "cost", str(error)) from None


def cost_on(spec: Spec, course: Any) -> Cost:
    """Return the planner's cost on this course, with the terms of the user's own."""
    own: Any = spec.own.cost
    if own is not None and not callable(own):
        return spec.own.with_terms(own)
    cost = spec.entry.cost(replace(spec, course=course))
    return spec.own.with_terms(cost if own is None else own(cost))


def launch(
    spec: Spec,
    plant: Plant,
    controller: Any,
    referee: RefereeProtocol,
    navigation: Navigation | None = None,
) -> Iterator[Frame]:
    """Return the frames of a flight, of the parts that `build` returned. navigation: default: the
    spec's."""
    from controllers.mppi import MPPI
    from controllers.sampled_trajectories import take_snapshot

    snapshot = partial(take_snapshot, controller) if isinstance(controller, MPPI) else None
    navigation = navigation or navigation_of(spec, plant, controller, referee)
    return simulate(
        plant, controller, referee, spec.planner.mppi.dt, CLOCKS[spec.clock](), snapshot, navigation
    )


def navigation_of(
    spec: Spec, plant: Plant, controller: Controller, referee: RefereeProtocol
) -> Navigation:
    """Return what makes the estimates that the controller is given, at the start of a flight."""
    dt, rest = spec.planner.mppi.dt, tuple(controller.rest.tolist())
    if spec.system != "quadrotor" or spec.own.system:
        return exact_navigation(plant.state, referee, rest, dt)
    # a pilot has no model that could be adapted
    adapts = spec.planner.mppi.adapt and spec.pilot is None
    if spec.sensing:
        source = _sensed(spec, plant, adapts)
    else:
        learner = VehicleLearner.for_exact_states(spec.model, dt) if adapts else None
        source = TrueState(plant.state, dt, learner)
    late = spec.vehicle.latency or spec.clock == "wall"
    gates = GateCounter(spec.course, spec.laps) if spec.sensing or late else RefereeCount(referee)
    return Navigation(source, gates, Commands(rest, spec.vehicle.latency), dt, spec.model)


def _sensed(spec: Spec, plant: Plant, adapt: bool) -> SensedState:
    """The estimates from a flight's sensors. adapt: whether the planner uses what is learnt of the
    vehicle."""
    sensing, dt, flown = spec.sensing, spec.planner.mppi.dt, spec.flown_course
    assert sensing
    assert sensing.imu
    lag = getattr(plant, "velocity_lag", 0.0)
    sensors = Sensors(
        sensing, spec.streams.sensors, spec.vehicle, distinct(flown.gates), lag, flown.obstacles
    )
    sensors.warm_up(plant.state, plant.dt)
    sensors.observe(plant.state)
    gates = distinct(spec.course.gates)
    return SensedState(
        sensors,
        Estimator(sensing, gates, spec.course.start, -WARM_UP, spec.displace_gates),
        BodyRates(spec.model, dt, sensing.imu),
        VehicleLearner.for_sensors(spec.model, dt, sensing.imu),
        None if spec.pilot else CourseEstimate(spec.course),  # a pilot flies by the map
        dt,
        adapt,
        rotor_std(sensing.rotors, spec.vehicle),
    )


def distinct(gates: Sequence[Gate]) -> tuple[Gate, ...]:
    """Return each gate once, in the order of the course."""
    return tuple(dict.fromkeys(gates))


def rotor_std(config: RotorConfig | None, vehicle: Vehicle) -> float:
    """Return the standard deviation of the thrust by the speeds of four independent rotors at full
    speed [m/s^2]."""
    if config is None or vehicle.rotors is None:
        return LEAST_ROTOR_STD
    c2, c1, _ = vehicle.rotors.thrust_map
    per_speed = 2 * c2 * vehicle.rotors.omega_max + c1  # [N s/rad]
    return max(LEAST_ROTOR_STD, 2 * config.noise * per_speed / vehicle.mass)


def flight_frames(spec: Spec) -> Iterator[Frame]:
    """Build and simulate: one Frame for each control step, the last one with the outcome."""
    plant, controller, referee = build(spec)
    with closing(plant):
        yield from launch(spec, plant, controller, referee)
