"""Build the navigation of a Spec, which makes the estimates for the controller."""

from __future__ import annotations

from quadsim.config.build_plant import adapts, learns_rotors
from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
from quadsim.course.frames import frames
from quadsim.physics.faults import BiasJump, SensorFault
from quadsim.physics.link import command_latency
from quadsim.physics.plant import Plant
from quadsim.racing.flight import RefereeProtocol
from quadsim.sensing import Sensing
from quadsim.sensing.config import RotorConfig
from quadsim.sensing.estimation.body_rates import BodyRates
from quadsim.sensing.estimation.delay_learner import DelayLearner
from quadsim.sensing.estimation.estimator import Estimator
from quadsim.sensing.estimation.prediction import Commands, GateCounter
from quadsim.sensing.estimation.vehicle_learner import VehicleLearner
from quadsim.sensing.known_course import KnownCourse
from quadsim.sensing.navigation import (
    CourseEstimate,
    Estimators,
    GateCount,
    Navigation,
    RefereeCount,
    RefereeOrPath,
    SensedState,
    StateSource,
    TrueState,
)
from quadsim.sensing.pixel_camera import Eye
from quadsim.sensing.pixels.tracker import Tracker
from quadsim.sensing.sensors import WARM_UP, Sensors
from quadsim.streams import sensor_streams
from quadsim.vehicle import Vehicle

LEAST_ROTOR_STD = 0.05  # least standard deviation of the thrust from rotor speeds [m/s^2]


def navigation_of(
    spec: Spec, plant: Plant, referee: RefereeProtocol, rest: tuple[float, ...]
) -> Navigation:
    """Return the navigation of a flight, which makes the estimates for the controller.

    Args:
        spec: specification of the flight.
        plant: plant of the flight, at the start.
        referee: referee of the flight, which may count the gates.
        rest: the control that acts until the first one is given  (n_u,).
    """
    return Navigation(
        source=_state_source(spec, plant),
        gates=_gate_count(spec, referee),
        commands=Commands(rest, _latency(spec), spec.link.period),
        dt=spec.planner.mppi.dt,
        nominal=spec.model,
        predicts=spec.predict,
        delay=DelayLearner(spec.model, spec.planner.mppi.dt) if learns_delay(spec) else None,
    )


def learns_delay(spec: Spec) -> bool:
    """Return whether a delay of the commands is estimated in flight."""
    return learns_rotors(spec) and spec.predict


def _latency(spec: Spec) -> float:
    """Return the time from a command to its effect, apart from the wait for the link [s]."""
    return command_latency(spec.vehicle.latency, spec.link.latency, spec.model.delay)


def _gate_count(spec: Spec, referee: RefereeProtocol) -> GateCount:
    """Return the count of the gates passed.

    The referee counts the gates, unless the state is estimated or predicted ahead.
    """
    is_late = _latency(spec) or spec.link.rate or spec.clock == "wall"
    if spec.sensing or (is_late and spec.predict):
        return GateCounter(spec.course, spec.laps)
    if learns_delay(spec):
        return RefereeOrPath(referee, spec.course, spec.laps)
    return RefereeCount(referee)


def _state_source(spec: Spec, plant: Plant) -> StateSource:
    """Return the source of the present state: the true state, or an estimate by the sensors."""
    if spec.sensing:
        return _sensed_state(spec, spec.sensing, plant)
    dt = spec.planner.mppi.dt
    learner = None
    if adapts(spec):
        learner = VehicleLearner.for_exact_states(spec.model, dt, vehicle=_known_vehicle(spec))
    course = None
    flown = spec.flown_course
    if spec.known_from is not None and flown != spec.course:
        course = KnownCourse(spec.course, flown, spec.known_from)
    return TrueState(plant.state, dt, learner, course)


def _known_vehicle(spec: Spec) -> Vehicle | None:
    """Return the vehicle whose rotors are learned, None if they are not."""
    return spec.vehicle if learns_rotors(spec) else None


def _sensed_state(spec: Spec, sensing: Sensing, plant: Plant) -> SensedState:
    """Return the source of the state that is estimated from the sensors of a flight.

    Args:
        spec: specification of the flight.
        sensing: sensors of the flight.
        plant: plant of the flight.

    Raises:
        SettingError: there is no inertial measurement unit among the sensors.
    """
    imu = sensing.imu
    if imu is None:
        raise SettingError("sensing", f"expected an imu, got none in {sensing.name}")
    dt = spec.planner.mppi.dt

    # A learned pilot flies by the map.
    course = None if spec.pilot else CourseEstimate(spec.course)
    gates = frames(spec.course.gates)
    estimator = Estimator(
        sensing,
        gates=gates,
        start=spec.start or spec.course.start,
        t=-WARM_UP,
        displaced=spec.displacement.gates,
    )
    state = SensedState(
        sensors=_sensors(spec, sensing, plant),
        estimators=Estimators(
            estimator=estimator,
            tracker=Tracker(sensing.pixels, gates) if sensing.pixels else None,
            body_rates=BodyRates(spec.model, dt, imu),
            learner=VehicleLearner.for_sensors(spec.model, dt, imu, vehicle=_known_vehicle(spec)),
            course=course,
        ),
        dt=dt,
        adapt=adapts(spec),
        rotor_std=rotor_std(sensing.rotors, spec.vehicle),
    )
    if spec.record_sensing:
        state.keep()
    return state


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
        eye=_eye(spec, sensing),
    )
    sensors.warm_up(plant.state, plant.dt)
    sensors.observe(plant.state)
    return sensors


def _eye(spec: Spec, sensing: Sensing) -> Eye | None:
    """Return the renderer of a pixel camera's pictures, None if there is no pixel camera."""
    if sensing.pixels is None:
        return None
    # Imported here, as it loads the compiler.
    from quadsim.render.eye import CourseEye

    pixels = sensor_streams(spec.streams.sensors).pixels
    return CourseEye(sensing.pixels, pixels, spec.flown_course)


def rotor_std(config: RotorConfig | None, vehicle: Vehicle) -> float:
    """Return the standard deviation of the thrust computed from rotor speeds [m/s^2].

    It applies at full rotor speed, with independent noise of the four rotors.
    """
    if config is None or vehicle.rotors is None:
        return LEAST_ROTOR_STD
    c2, c1, _ = vehicle.rotors.thrust_map
    per_speed = 2 * c2 * vehicle.rotors.motor_omega_max + c1  # [N s/rad]
    return max(LEAST_ROTOR_STD, 2 * config.noise * per_speed / vehicle.mass)
