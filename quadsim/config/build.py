"""Build the plant, the controller and the referee of a Spec, and simulate its flight."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from functools import partial
from math import sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.random import SeedSequence

from controllers.costs import Cost
from controllers.costs.race import race_cost
from controllers.costs.race_view import with_view
from controllers.costs.reference import ReferenceWeights, reference_cost
from controllers.in_flight import PlannerInFlight
from controllers.learned.pilot import PilotController
from controllers.plan import PlannerSnapshot
from controllers.presets import Planner
from quadsim.config.changes import planner_after
from quadsim.config.checks import expect_new_log
from quadsim.config.parts import called, made
from quadsim.config.reference import reference_of
from quadsim.config.settings import SETTINGS, SettingError
from quadsim.config.spec import Spec
from quadsim.course import Course
from quadsim.course.frames import frames
from quadsim.dynamics import System
from quadsim.dynamics.quadrotor import State, quadrotor
from quadsim.files.values import checked
from quadsim.files.yaml_errors import shown_value
from quadsim.firmware.actuators import (
    BetaflightActuators,
    FirmwareLog,
    ImuNoise,
    motors_reversed,
)
from quadsim.firmware.configuration import eeprom_with_log
from quadsim.firmware.identified import firmware_for
from quadsim.physics.actuators import Actuators
from quadsim.physics.domain_randomization import gusts
from quadsim.physics.faults import BiasJump, CommandLoss, RotorFault, SensorFault
from quadsim.physics.link import Link
from quadsim.physics.plant import (
    PLANTS,
    Arena,
    LossyLink,
    NamedPlant,
    Plant,
    PlantName,
    SharedPlant,
    start_state,
)
from quadsim.physics.rotorpy_plant import RotorpyPlant
from quadsim.racing.clock import CLOCKS, Clock
from quadsim.racing.events import Frame
from quadsim.racing.flight import Controller, PlainController, RefereeProtocol, rest_of, simulate
from quadsim.racing.own_parts import check_counts, checked_control
from quadsim.racing.referee import Referee
from quadsim.record.schema import NumberChange
from quadsim.sensing import Sensing
from quadsim.sensing.config import ImuConfig, RotorConfig
from quadsim.sensing.estimation.body_rates import BodyRates
from quadsim.sensing.estimation.estimator import Estimator
from quadsim.sensing.estimation.prediction import Commands, GateCounter
from quadsim.sensing.estimation.vehicle_learner import VehicleLearner
from quadsim.sensing.navigation import (
    CourseEstimate,
    GateCount,
    Navigation,
    RefereeCount,
    SensedState,
    StateSource,
    TrueState,
)
from quadsim.sensing.sensors import WARM_UP, Sensors
from quadsim.streams import sensor_streams
from quadsim.vehicle import Vehicle

if TYPE_CHECKING:
    from controllers.mppi import MPPI

LEAST_ROTOR_STD = 0.05  # least standard deviation of the thrust from rotor speeds [m/s^2]


class FlightParts(NamedTuple):
    """The plant, the controller and the referee of one flight. Their owner closes the plant."""

    plant: Plant
    controller: Controller
    referee: RefereeProtocol


def with_threads(spec: Spec) -> Spec:
    """Use the spec's number of CPU threads from now on, and return the spec with it filled in.

    Raises:
        SettingError: the number is less than 1, or more than this machine has.
    """
    from controllers.lanes.threads import use_threads  # here: it loads the compiler

    return spec.on_threads(use_threads(spec.threads))


def use_threads_of(given: object) -> None:
    """Use this number of CPU threads from now on, or leave the number as it is for None.

    Raises:
        SettingError: the number is less than 1, or more than this machine has.
    """
    if given is None:
        return
    from controllers.lanes.threads import use_threads  # here: it loads the compiler

    use_threads(cast(int, checked("threads", given, SETTINGS["threads"].kind)))


def build(
    spec: Spec, arena: Arena | None = None, referee: RefereeProtocol | None = None
) -> FlightParts:
    """Return the plant, the controller and the referee of one flight. The caller closes the plant.

    Args:
        spec: specification of the flight.
        arena: the world that its vehicle shares with others; None: a world of its own.
        referee: the referee; None: the referee of the spec.

    Raises:
        SettingError: an object of the user's own cannot take its part (a ValueError).
        ValueError: course, laps and vehicle do not fit together.
    """
    referee = referee or referee_of(spec)
    controller = controller_of(spec)
    plant = plant_of(spec, arena)
    losses = [fault for fault in spec.drawn_faults if isinstance(fault, CommandLoss)]
    if losses:
        plant = LossyLink(plant, losses)
    return FlightParts(plant, controller, referee)


def controller_of(spec: Spec) -> Controller:
    """Return the controller of a flight: the user's own, the learned pilot, or the planner.

    Raises:
        SettingError: the user's controller has no control at rest of 4 numbers, or a deadline is
            given that it cannot keep.
    """
    own = made("controller", spec.controller, spec)
    if own is None:
        return pilot_of(spec) or planner_of(spec)
    rest = system_of(spec).rest
    controller = own if isinstance(own, Controller) else PlainController(own, rest)
    checked_control(controller, controller.rest, len(rest), "rest")
    if spec.deadline_ms is not None:
        from controllers.mppi import MPPI  # here: it loads the compiler

        if not isinstance(controller, MPPI):
            wanted = f"expected none for {type(own).__name__}, as only MPPI keeps it by its samples"
            raise SettingError("deadline_ms", f"{wanted}, got {spec.deadline_ms:g}")
    return controller


def system_of(spec: Spec) -> System:
    """Return the planner's model of the vehicle; one step of it is one control period."""
    return quadrotor(spec.model, spec.planner.mppi.dt)


def start_of(spec: Spec) -> State:
    """Return the nominal state at the start."""
    return start_state(spec.start or spec.course.start, spec.vehicle.radius)


def referee_of(spec: Spec) -> RefereeProtocol:
    """Return the referee of one flight: the user's own, or the racing referee.

    Raises:
        SettingError: the user's referee has no counts or no outcome.
        ValueError: course, laps and vehicle do not fit together.
    """
    own = made("referee", spec.referee, spec)
    if own is not None:
        check_counts(own)
        return own
    radius = spec.vehicle.radius
    return Referee(
        spec.flown_course,
        radius,
        laps=spec.laps,
        timeout=spec.timeout,
        penalties=spec.penalties,
        patience=spec.patience,
    )


def plant_of(spec: Spec, arena: Arena | None = None) -> Plant:
    """Return the plant of one flight: the user's own, or a named one. The caller closes it.

    The seed randomizes the vehicle, the start and the gusts of a named plant.

    Args:
        spec: specification of the flight.
        arena: the world that the vehicle shares with others; None: a world of its own.
    """
    if not isinstance(spec.plant, str):
        return NamedPlant(made("plant", spec.plant, spec))
    plant = partial(SharedPlant, arena) if arena else PLANTS[cast(PlantName, spec.plant)]
    course = spec.flown_course
    faults = [fault for fault in spec.drawn_faults if isinstance(fault, RotorFault)]
    if plant is not RotorpyPlant:
        plant = partial(plant, actuators=partial(actuators_of, spec))
    if spec.randomize == 0:
        return plant(course, spec.vehicle, spec.plant_dt, start=spec.start, faults=faults)
    streams = spec.streams
    varied = spec.variation
    return plant(
        course,
        varied.vehicle(spec.vehicle),
        spec.plant_dt,
        start=varied.start(spec.start or spec.course.start),
        body=varied.body(spec.vehicle),
        gusts=gusts(streams.gusts, varied.gust, spec.plant_dt),
        faults=faults,
    )


def actuators_of(
    spec: Spec, vehicle: Vehicle, dt: float, faults: Sequence[RotorFault]
) -> Actuators | BetaflightActuators:
    """Return the actuators of a vehicle, behind the spec's link and flight controller.

    Before the firmware, each command is reached within a control period.

    Args:
        spec: specification of the flight.
        vehicle: as it is flown, which the seed may have changed.
        dt: physics step [s].
        faults: faults of its rotors.

    Raises:
        FirmwareError: the firmware is not built, or does not arm.
        FileError: it does not take its configuration.
        SettingError: there is a file already where its log would be written.
    """
    stream = spec.streams.link
    if spec.betaflight is None:
        link = Link(dt, vehicle.latency, spec.link, stream=stream)
        return Actuators(vehicle, dt, faults, link)
    if spec.blackbox is not None:
        expect_new_log(spec.blackbox)
    link = Link(dt, vehicle.latency, spec.link, spec.planner.mppi.dt, stream)
    built, configuration = firmware_for(vehicle, spec.betaflight)
    log = None
    if spec.blackbox is not None:
        text, reversed_ = spec.betaflight, motors_reversed(vehicle)
        log = FirmwareLog(Path(spec.blackbox), eeprom_with_log(built.program, text, reversed_))
    noise = _imu_noise(spec, spec.sensing.imu, dt) if spec.sensing and spec.sensing.imu else None
    return BetaflightActuators(vehicle, dt, built, configuration, faults, link, log, noise)


def _imu_noise(spec: Spec, imu: ImuConfig, dt: float) -> ImuNoise:
    """Return the noise of the firmware's unit, which samples every dt [s].

    It has the density of the unit that the estimator reads.
    """
    samples = 1.0 / (imu.rate * dt)  # of the firmware's to one of the estimator's
    stream = sensor_streams(spec.streams.sensors).flight_controller
    scale = sqrt(samples)
    return ImuNoise(scale * imu.gyro_noise, scale * imu.accelerometer_noise, stream)


def pilot_of(spec: Spec) -> PilotController | None:
    """Return the learned pilot that flies in the planner's place, None without one."""
    if spec.pilot is None:
        return None
    return PilotController(spec.pilot, spec.course, spec.laps, system_of(spec).rest)


def planner_of(spec: Spec, stream: SeedSequence | None = None) -> MPPI:
    """Return the planner of a flight, without the other parts.

    Args:
        spec: specification of the flight.
        stream: seed of the planner's perturbations; None: the flight's own.

    Raises:
        SettingError: the user's term or cost cannot be compiled.
    """
    from controllers.mppi import MPPI  # here: it loads the compiler

    if stream is None:
        stream = spec.streams.planner
    cost = cost_on(spec, spec.course)
    if spec.terms or spec.cost is not None:
        check_cost(spec, cost)
    sampling = spec.planner.sampling
    return MPPI(system_of(spec), cost, sampling, spec.planner.mppi, stream, partial(cost_on, spec))


def check_cost(spec: Spec, cost: Cost) -> None:
    """Check that a cost with the user's own parts can be compiled. Raises SettingError."""
    from controllers.lanes.planner_loops import module_source
    from controllers.lanes.trace import TraceError

    try:
        module_source(system_of(spec), cost, np.float32)
        _check_rows(spec, cost)
    except (TraceError, ValueError) as error:
        raise SettingError("terms" if spec.terms else "cost", one_line(error)) from None


def _check_rows(spec: Spec, cost: Cost) -> None:
    """Check the numbers of a cost at the start, by the functions that the planner calls.

    Raises:
        ValueError: weights, targets or the guide have another shape, or are not finite.
    """
    horizon = spec.planner.mppi.horizon
    cost.numbers(horizon)
    if cost.obstacles:
        _ = cost.crash_term
    x = np.array(start_of(spec))
    rows = cost.targets_from(0, x)
    if not len(rows) or not np.isfinite(rows).all():
        raise ValueError(f"cost {cost.name}: expected finite targets from the start on, got none")
    if cost.guide:
        shape = (horizon, len(system_of(spec).rest))
        guide = cost.guide(0, x, horizon)
        if np.shape(guide) != shape or not np.isfinite(np.asarray(guide, float)).all():
            wanted = f"expected finite controls of shape {shape}"
            raise ValueError(f"cost {cost.name}: guide: {wanted}, got {shown_value(guide)}")


def cost_on(spec: Spec, course: Course) -> Cost:
    """Return the planner's cost on this course, followed by the user's own terms.

    Raises:
        SettingError: the user's cost is none, or two terms have the same name (a ValueError).
    """
    if isinstance(spec.cost, Cost):
        cost = spec.cost
    elif spec.cost is None:
        cost = race_cost_on(spec, course)
    else:
        cost = changed_cost(spec.cost, race_cost_on(spec, course))
    if not spec.terms:
        return cost
    try:
        return replace(cost, terms=(*cost.terms, *spec.terms))
    except ValueError as error:
        raise SettingError("terms", str(error)) from None


def changed_cost(change: Callable[[Cost], object], cost: Cost) -> Cost:
    """Return the cost that the user's function makes of the default one.

    Raises:
        SettingError: the function returns anything else than a Cost, or one that is inconsistent.
    """
    try:
        found = called("cost", change, "the default Cost", cost)
    except SettingError:  # it names itself
        raise
    except ValueError as error:  # a Cost whose fields do not fit together
        raise SettingError("cost", one_line(error)) from None
    if not isinstance(found, Cost):
        wanted = f"expected {shown_value(change)} to return a Cost"
        missing = ": is a return missing?" if found is None else ""
        raise SettingError("cost", f"{wanted}, got {shown_value(found)}{missing}")
    return found


def one_line(error: Exception) -> str:
    """Return the text of an error on one line."""
    return " ".join(str(error).split())


def race_cost_on(spec: Spec, course: Course) -> Cost:
    """Return the racing or reference cost on this course, with the planner's weights.

    With a camera and a view_weight, a term keeps the nose in the direction of flight.
    """
    weights = spec.planner.cost
    radius = spec.vehicle.radius
    if isinstance(weights, ReferenceWeights):
        if spec.reference is None:
            raise SettingError("reference", "expected the solution that this preset follows")
        reference = reference_of(spec.reference, spec.vehicle, spec.planner.mppi.dt)
        return reference_cost(course, radius, weights, reference)
    cost = race_cost(course, radius, weights, spec.laps)
    if spec.sensing and spec.sensing.camera and spec.view_weight:
        return with_view(cost, spec.view_weight)
    return cost


@dataclass(frozen=True)
class Launched:
    """The parts of a flight that is about to begin, and what `simulate` needs beside them."""

    plant: Plant
    # a PlannerInFlight[NumberChange] if the controller is an MPPI
    controller: Controller
    referee: RefereeProtocol
    period: float  # [s]
    clock: Clock
    snapshot: Callable[[], PlannerSnapshot | None] | None
    navigation: Navigation
    time_limit: float | None  # [s]

    @property
    def arguments(self) -> dict[str, Any]:
        """The arguments of `simulate`, by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}


def launch(spec: Spec, parts: FlightParts, navigation: Navigation | None = None) -> Iterator[Frame]:
    """Return the frames of a flight with the parts that `build` returned.

    Args:
        spec: specification of the flight.
        parts: the parts, which serve for one flight only.
        navigation: source of the controller's estimates; None: the spec's.
    """
    return simulate(**launched(spec, parts, navigation).arguments)


def launched(spec: Spec, parts: FlightParts, navigation: Navigation | None = None) -> Launched:
    """Return what `simulate` needs for a flight; see `launch` for the arguments."""
    from controllers.mppi import MPPI  # here: it loads the compiler

    plant, controller, referee = parts
    navigation = navigation or navigation_of(spec, parts)
    snapshot = None
    if isinstance(controller, MPPI):
        controller = planner_in_flight(spec, controller)
        snapshot = controller.snapshot
    return Launched(
        plant=plant,
        controller=controller,
        referee=referee,
        period=spec.planner.mppi.dt,
        clock=CLOCKS[spec.clock](),
        snapshot=snapshot,
        navigation=navigation,
        # The racing referee has this limit of its own.
        time_limit=None if spec.referee is None else spec.timeout,
    )


def planner_in_flight(spec: Spec, planner: MPPI) -> PlannerInFlight[NumberChange]:
    """Return the planner of a flight with the changes and the deadline of the spec."""

    def make(numbers: Planner) -> MPPI:
        return planner_of(replace(spec, planner=numbers))

    return PlannerInFlight(
        planner=planner,
        numbers=spec.planner,
        make=make,
        changes=spec.changes,
        after=planner_after,
        deadline_ms=spec.deadline_ms,
    )


def navigation_of(spec: Spec, parts: FlightParts) -> Navigation:
    """Return the navigation of a flight, which makes the estimates for the controller."""
    return Navigation(
        source=_state_source(spec, parts.plant),
        gates=_gate_count(spec, parts.referee),
        commands=Commands(rest_of(parts.controller), _latency(spec), spec.link.period),
        dt=spec.planner.mppi.dt,
        nominal=spec.model,
    )


def _latency(spec: Spec) -> float:
    """Return the time from a command to its effect, apart from the wait for the link [s]."""
    return spec.vehicle.latency + spec.link.latency + spec.model.delay


def _gate_count(spec: Spec, referee: RefereeProtocol) -> GateCount:
    """Return the count of the gates passed.

    The referee counts them unless the state is estimated, or is predicted ahead of the referee.
    """
    is_ahead = _latency(spec) or spec.link.rate or spec.clock == "wall"
    if spec.sensing or is_ahead:
        return GateCounter(spec.course, spec.laps)
    return RefereeCount(referee)


def _state_source(spec: Spec, plant: Plant) -> StateSource:
    """Return the source of the present state: the true state, or an estimate by the sensors."""
    # A pilot has no model that could be adapted.
    adapts = spec.planner.mppi.adapt and spec.pilot is None
    if spec.sensing:
        return _sensed_state(spec, spec.sensing, plant, adapts)
    dt = spec.planner.mppi.dt
    learner = VehicleLearner.for_exact_states(spec.model, dt) if adapts else None
    return TrueState(plant.state, dt, learner)


def _sensed_state(spec: Spec, sensing: Sensing, plant: Plant, adapts: bool) -> SensedState:
    """Return the source of the state that is estimated from the sensors of a flight.

    Args:
        spec: specification of the flight.
        sensing: its sensors.
        plant: its plant.
        adapts: whether the planner uses the vehicle parameters estimated in flight.

    Raises:
        SettingError: there is no inertial measurement unit among the sensors.
    """
    imu = sensing.imu
    if imu is None:
        raise SettingError("sensing", f"expected an imu, got none in {sensing.name}")
    dt = spec.planner.mppi.dt

    # A learned pilot flies by the map.
    course = None if spec.pilot else CourseEstimate(spec.course)
    estimator = Estimator(
        sensing,
        gates=frames(spec.course.gates),
        start=spec.start or spec.course.start,
        t=-WARM_UP,
        displaced=spec.displace_gates,
    )
    return SensedState(
        sensors=_sensors(spec, sensing, plant),
        estimator=estimator,
        body_rates=BodyRates(spec.model, dt, imu),
        learner=VehicleLearner.for_sensors(spec.model, dt, imu),
        course=course,
        dt=dt,
        adapt=adapts,
        rotor_std=rotor_std(sensing.rotors, spec.vehicle),
    )


def _sensors(spec: Spec, sensing: Sensing, plant: Plant) -> Sensors:
    """Return the sensors of a flight after their warm-up, at the first state of the plant."""
    flown = spec.flown_course
    sensors = Sensors(
        sensing,
        spec.streams.sensors,
        spec.vehicle,
        gates=frames(flown.gates),
        velocity_lag=getattr(plant, "velocity_lag", 0.0),
        obstacles=flown.obstacles,
        faults=[f for f in spec.drawn_faults if isinstance(f, SensorFault | BiasJump)],
    )
    sensors.warm_up(plant.state, plant.dt)
    sensors.observe(plant.state)
    return sensors


def rotor_std(config: RotorConfig | None, vehicle: Vehicle) -> float:
    """Return the standard deviation of the thrust computed from rotor speeds [m/s^2].

    It is the value at full rotor speed, for independent noise of the four rotors.
    """
    if config is None or vehicle.rotors is None:
        return LEAST_ROTOR_STD
    c2, c1, _ = vehicle.rotors.thrust_map
    per_speed = 2 * c2 * vehicle.rotors.omega_max + c1  # [N s/rad]
    return max(LEAST_ROTOR_STD, 2 * config.noise * per_speed / vehicle.mass)


def flight_frames(spec: Spec) -> Iterator[Frame]:
    """Build and simulate a flight; yield a Frame per control step, the last with the outcome."""
    parts = build(spec)
    with closing(parts.plant):
        yield from launch(spec, parts)
