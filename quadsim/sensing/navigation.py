"""Navigation, which makes the Estimate that a controller plans with.

    sensors -> estimator -> present state
    present state -> model under the commands given -> state in which the next control acts

A flight may also ask for the present state without this prediction.

A Navigation is put together from three parts:

* a source of the present state: the true state (TrueState) or an estimate (SensedState);
* the commands given so far, under which the model predicts how the vehicle moves until the next
  control acts;
* a count of the gates passed: by the referee (RefereeCount) or by the estimated path
  (GateCounter).

The estimator, the prediction and the count by the path receive only measurements, commands and the
map; the true state is used only to record their errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter
from typing import NamedTuple, Protocol

import numpy as np

from quadsim.course import Course, EstimatedGate
from quadsim.course.frames import frame_numbers
from quadsim.dynamics.control_periods import ControlPeriods
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.dynamics.rotors import ALL_ONE
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import Vec3
from quadsim.sensing.estimate_record import estimate_row
from quadsim.sensing.estimation.body_rates import BodyRates
from quadsim.sensing.estimation.delay_learner import DelayLearner
from quadsim.sensing.estimation.estimator import Estimator
from quadsim.sensing.estimation.prediction import (
    Acted,
    Commands,
    GateCounter,
    Piece,
    mean_command,
    predict,
)
from quadsim.sensing.estimation.vehicle_learner import VehicleLearner
from quadsim.sensing.kept import Kept
from quadsim.sensing.known_course import KnownCourse
from quadsim.sensing.measurements import Corners, Inertial, Measurement, Photo, RotorThrust
from quadsim.sensing.pixels.tracker import Tracker
from quadsim.sensing.sensors import Sensors
from quadsim.sensing.state import FilterState

# [m] change of a gate's estimated position or standard deviation that makes a new course
MOVED = 0.01
# weight of the last planning time in the running mean of planning times
PLAN_TIME = 0.1
# tolerance of the time between two samples that are a control period apart, as a share of it
ON_TIME = 0.1
# largest time from the last sample to now, as a share of a control period
RECENT = 0.5
# A number of periods is rounded if it differs by less from a whole number.
WHOLE = 1e-6
# [s] Instants that differ by less count as equal.
ROUNDING = 1e-9


class Present(NamedTuple):
    """The present state, with the estimated model and course."""

    # state now; for a quadrotor a State  (n_x,)
    x: tuple[float, ...]
    # the estimated model; None: the model is not estimated
    model: ModelParams | None = None
    # the estimated course; None: only the map is known
    course: Course | None = None


class PictureCount(NamedTuple):
    """Numbers of corners in a picture."""

    in_view: int
    found: int


class StateSource(Protocol):
    """A source of the present state."""

    @property
    def corners(self) -> Corners | None:
        """The corners of gates found in the last picture, for display; None without a camera."""
        ...

    @property
    def learner(self) -> VehicleLearner | None:
        """The estimator of vehicle parameters, for display; None: they are not estimated."""
        ...

    def watch(self, state: PlantState) -> None:
        """Note the plant's state after a physics step."""
        ...

    def now(self, t: float, acted: Sequence[Piece], periods: int) -> Present:
        """Return the present state, model and course.

        Args:
            t: time now [s].
            acted: commands that have acted since the last call; none at the first call.
            periods: control periods since the last call.
        """
        ...

    def record(self, state: PlantState) -> tuple[float, ...]:
        """Return the columns of ESTIMATE_UNITS for this true state; () if the state is known."""
        ...

    def kept(self) -> Kept | None:
        """Return the stored measurements since the last call, None if none are stored."""
        ...


class GateCount(Protocol):
    """The onboard count of passed gates."""

    def at(self, x: tuple[float, ...], course: Course | None) -> int:
        """Return the number of gates passed when the vehicle has the state x.

        Args:
            x: state, which begins with the position [m]  (n_x,).
            course: the estimated course; None: the course of the map.
        """
        ...


class PassedGates(Protocol):
    """An object that counts gates by the true state, such as a referee."""

    @property
    def passed(self) -> int:
        """The number of gates passed since the start."""
        ...


class RefereeCount:
    """The true number of gates passed, by the referee."""

    def __init__(self, referee: PassedGates):
        """Use the gate count of the flight's referee."""
        self._referee = referee

    def at(self, x: tuple[float, ...], course: Course | None) -> int:
        """Return the referee's count, for any state."""
        return self._referee.passed


class RefereeOrPath:
    """The true number of gates passed, and those on the way to the state in which a control acts.

    It is for a delay that is found in flight.
    """

    def __init__(self, referee: PassedGates, course: Course, laps: int):
        """Use the gate count of the flight's referee, on a course of some laps."""
        self._referee = referee
        self._path = GateCounter(course, laps)

    def at(self, x: tuple[float, ...], course: Course | None) -> int:
        """Return the larger one of the referee's count and that by the path to x."""
        self._path.passed = max(self._path.at(x, course), self._referee.passed)
        return self._path.passed


class TrueState:
    """The plant's true state, and the vehicle parameters estimated from it."""

    corners = None

    def __init__(
        self,
        state: PlantState,
        dt: float,
        learner: VehicleLearner | None = None,
        course: KnownCourse | None = None,
    ):
        """Start at the plant's first state.

        Args:
            state: state of the plant.
            dt: control period [s].
            learner: estimator of the vehicle's parameters; None: they are not estimated.
            course: the course that is known in flight; None: the map alone.
        """
        self._course = course
        self._state = state
        self._dt = dt
        self.learner = learner
        # state at the last call of `now`
        self._before: PlantState | None = None

    def watch(self, state: PlantState) -> None:
        """Note the plant's state after a physics step."""
        self._state = state

    def now(self, t: float, acted: Sequence[Piece], periods: int) -> Present:
        """Return the true state, and the model estimated from true states."""
        before = self._before
        self._before = self._state
        course = None
        if self._course is not None:
            course = self._course.seen_from(State(*self._state.x).position)
        if self.learner is None:
            return Present(self._state.x, course=course)
        if before is not None and periods:
            duration = self._whole_periods(t - before.t) * self._dt
            self.learner.learn_from_states(
                State(*before.x), State(*self._state.x), Acted.of(acted), duration
            )
        return Present(self._state.x, self.learner.model, course)

    def record(self, state: PlantState) -> tuple[float, ...]:
        """Return (), as nothing is estimated."""
        return ()

    def kept(self) -> None:
        """Return None, as nothing is measured."""

    def _whole_periods(self, duration: float) -> float:
        """Return the number of control periods in a duration [s].

        The number is not whole if planning took longer on the wall clock.
        """
        periods = duration / self._dt
        return round(periods) if abs(periods - round(periods)) <= WHOLE else periods


class Estimators(NamedTuple):
    """The estimators of a flight with sensors."""

    # position, velocity, attitude and gate positions
    estimator: Estimator
    # finds corners of gates in pictures; None without pictures
    tracker: Tracker | None
    # body rates and angular accelerations
    body_rates: BodyRates
    # the thrust and the vehicle's parameters
    learner: VehicleLearner
    # None: the controller uses the map
    course: CourseEstimate | None


class SensedState:
    """The state, the vehicle parameters and the course, estimated from measurements."""

    def __init__(
        self,
        sensors: Sensors,
        estimators: Estimators,
        dt: float,
        adapt: bool,
        rotor_std: float,
    ):
        """Combine sensors and estimators.

        Args:
            sensors: sensors after their warm-up, at the flight's first state.
            estimators: the estimators, at the flight's first state.
            dt: control period [s].
            adapt: whether the planner uses the estimated vehicle parameters.
            rotor_std: standard deviation of the thrust from rotor speeds [m/s^2].
        """
        self._sensors = sensors
        self._estimator = estimators.estimator
        self._tracker = estimators.tracker
        self._body_rates = estimators.body_rates
        self.learner = estimators.learner
        self._course = estimators.course
        self._dt = dt
        self._adapt = adapt
        self._rotor_std = rotor_std
        # samples of the present period
        self._inertial: list[Inertial] = []
        # time [s] and body rates [rad/s] of the last used sample; None if there was none
        self._last_rates: tuple[float, Vec3] | None = None
        # thrust from rotor speeds, the latest since the last estimate; None: none has arrived
        self._rotors: RotorThrust | None = None
        self.corners: Corners | None = None
        self._picture = PictureCount(in_view=0, found=0)
        # the last estimate, and its time [s]
        self._nominal = self._estimator.state.nominal
        self._t = self._nominal.t
        # duration of the last call of `now` [ms]
        self._spent = 0.0
        # the measurements taken since the last call of `kept`; None: they are not kept
        self._kept: list[Measurement] | None = None

    def watch(self, state: PlantState) -> None:
        """Let the sensors sample the plant's state after a physics step."""
        self._sensors.observe(state)

    def now(self, t: float, acted: Sequence[Piece], periods: int) -> Present:
        """Return the estimated state, model and course at t [s]."""
        began = perf_counter()

        # The filter gives position, velocity and attitude; then follow body rates, thrust and
        # vehicle parameters, which need these.
        self._take_measurements(t)
        nominal = self._nominal
        if periods:
            self._follow_vehicle(t, Control(*mean_command(acted)), periods)
        if self._rotors:
            self.learner.learn_from_rotors(self._rotors.thrust, self._rotor_std)
        x = State.of(
            nominal.position,
            nominal.velocity,
            nominal.attitude,
            self._body_rates.rates,
            self.learner.numbers.thrust,
            self._body_rates.angular_acceleration,
        )
        self._spent = 1e3 * (perf_counter() - began)
        model = self.learner.model if self._adapt else None
        course = self._course.updated(self._estimator.state) if self._course else None
        return Present(x, model, course)

    def record(self, state: PlantState) -> tuple[float, ...]:
        """Return the columns of ESTIMATE_UNITS for this true state."""
        # The last frame of a flight may lie within a control period.
        if state.t > self._t + ROUNDING:
            self._take_measurements(state.t)
        picture = self._picture
        self._picture = PictureCount(in_view=0, found=0)
        return estimate_row(
            state=self._sensors.truth or state,
            nominal=self._nominal,
            P=self._estimator.covariance(self._t),
            innovations=self._estimator.innovations,
            picture=picture,
            spent=self._spent,
        )

    def keep(self) -> None:
        """Keep every measurement from now on, for `kept`."""
        self._kept = []

    def kept(self) -> Kept | None:
        """Return the measurements since the last call, and the estimates that are not part of x."""
        if self._kept is None:
            return None
        taken = tuple(self._kept)
        self._kept.clear()
        nominal = self._nominal
        gates = self._course.centres(self._estimator.state) if self._course else None
        return Kept(self._t, taken, nominal.gyro_bias, nominal.accelerometer_bias, gates)

    def _take_measurements(self, t: float) -> None:
        """Update position, velocity and attitude to t [s] by the measurements that have arrived.

        Body rates and rotor thrusts are kept for `_follow_vehicle`.
        """
        self._rotors = None
        self._estimator.innovations.clear()
        for arrived in self._sensors.arrived(t):
            measurement = self._corners(arrived) if isinstance(arrived, Photo) else arrived
            if self._kept is not None:
                self._kept.append(measurement)
            match measurement:
                case RotorThrust():
                    # A measurement for the learner, not for the estimator.
                    self._rotors = measurement
                    continue
                case Inertial():
                    self._inertial.append(measurement)
                case Corners():
                    self.corners = measurement
                    self._picture = PictureCount(measurement.in_view, len(measurement.pixels))
            self._estimator.take(measurement)
        self._nominal = self._estimator.at(t)
        self._t = t

    def _corners(self, photo: Photo) -> Corners:
        """Return the corners of a picture, found near the positions that the state predicts."""
        assert self._tracker
        return self._tracker(photo, *self._estimator.seen_at(photo.t))

    def _follow_vehicle(self, t: float, u: Control, periods: int) -> None:
        """Update body rates, thrust and vehicle parameters to t.

        Args:
            t: time now [s].
            u: mean command since the last call.
            periods: control periods since the last call.
        """
        # The bias-corrected samples of the unit since the last call.
        nominal = self._nominal
        recent = [s for s in self._inertial if s.t > t - periods * self._dt + ROUNDING]
        self._inertial = recent
        force = None
        rates = None
        turned = None
        if recent:
            rates = nominal.rates(recent[-1])
            turned = self._turned(recent[-1].t, rates) if periods == 1 else None
            force = mean([nominal.force(s) for s in recent], [s.dt for s in recent])

        # The thrust reserved for roll and pitch is the larger of both ends of the period.
        for _ in range(periods):
            reserve = self._body_rates.reserve(u)
            before = self._body_rates.turning
            self._body_rates.advance(u, rates, self.learner.delivered)
            reserve = max(reserve, self._body_rates.reserve(u))
            after = self._body_rates.turning
            self.learner.learn_from_gyro((before, after), u, turned, force, nominal)
            self.learner.learn_from_force(u.thrust, reserve, force, nominal)

    def _turned(self, t: float, rates: Vec3) -> Vec3 | None:
        """Return the mean angular acceleration since the last sample of the gyroscope [rad/s^2].

        Args:
            t: time of the newest sample [s].
            rates: body rates of this sample [rad/s].

        Returns:
            The acceleration  (3,); None if the two samples are not one control period apart.
        """
        last, self._last_rates = self._last_rates, (t, rates)
        if last is None or self._t - t > RECENT * self._dt:
            return None
        if abs(t - last[0] - self._dt) > ON_TIME * self._dt:
            return None
        x, y, z = ((new - old) / self._dt for new, old in zip(rates, last[1], strict=True))
        return x, y, z


class CourseEstimate:
    """The course with estimated gate positions and their uncertainty."""

    def __init__(self, course: Course):
        """Begin with the course of the map."""
        self._map = course
        self._course = course
        self._numbers = frame_numbers(course.gates)
        # displacements of gates from the map, and their standard deviations [m]  (gates, 4)
        self._offsets: np.ndarray | None = None

    def centres(self, state: FilterState) -> np.ndarray | None:
        """Return the estimated centre of each gate's opening [m]  (gates, 3).

        None is returned if the map is exact.
        """
        if not len(state.gates):
            return None
        mapped = np.array([gate.position for gate in self._map.gates])
        return mapped + state.gates[np.array(self._numbers)]

    def updated(self, state: FilterState) -> Course:
        """Return the course with the gates' positions in a state of the filter.

        The same object is returned until a gate has moved by more than MOVED.
        """
        gates = len(set(self._numbers))
        moves = state.gates if len(state.gates) else np.zeros((gates, 3))
        offsets = np.column_stack([moves, state.gate_std(gates)])
        if self._offsets is not None and abs(offsets - self._offsets).max() < MOVED:
            return self._course
        self._offsets = offsets
        rows = offsets.tolist()
        moved = []
        for gate, number in zip(self._map.gates, self._numbers, strict=True):
            x, y, z, std = rows[number]
            moved.append(EstimatedGate.of(gate, (x, y, z), std))
        self._course = replace(self._map, gates=tuple(moved))
        return self._course


class Navigation:
    """Makes the Estimate for the controller, once each control period."""

    def __init__(
        self,
        source: StateSource,
        gates: GateCount,
        commands: Commands,
        dt: float,
        nominal: ModelParams | None,
        predicts: bool = True,
        delay: DelayLearner | None = None,
    ):
        """Put the parts together.

        Args:
            source: source of the present state.
            gates: counter of the gates passed.
            commands: commands given before the flight.
            dt: control period [s].
            nominal: model for the prediction until the next control acts, if no model is estimated;
                None: the next control acts in the present state.
            predicts: whether the controller is given the state in which its control acts, rather
                than the present state.
            delay: estimator of a delay of the commands; None: it is not estimated.
        """
        self._source = source
        self._gates = gates
        self._commands = commands
        self._dt = dt
        self._nominal = nominal
        self._predicts = predicts
        self._delay = delay
        # time of the last estimate [s]
        self._last: float | None = None
        self._periods = ControlPeriods(dt)
        # running mean of planning times [s]
        self._planning = 0.0

    @property
    def corners(self) -> Corners | None:
        """The corners of gates found in the last picture, for display; None without a camera."""
        return self._source.corners

    @property
    def learner(self) -> VehicleLearner | None:
        """The estimator of vehicle parameters, for display; None: they are not estimated."""
        return self._source.learner

    @property
    def rotor_shares(self) -> tuple[float, ...]:
        """The share of its nominal thrust that each rotor delivers, 1 if not estimated  (4,)."""
        learner = self.learner
        return tuple(learner.wrench.shares.tolist()) if learner and learner.wrench else ALL_ONE

    @property
    def learned_delay(self) -> float:
        """The delay of the commands that was found in flight [s]."""
        return self._delay.delay if self._delay else 0.0

    def watch(self, state: PlantState) -> None:
        """Note the plant's state after a physics step."""
        self._source.watch(state)

    def estimate(self, t: float) -> Estimate:
        """Return the Estimate for a control that is requested at t [s]."""
        # The present state, given the commands that have acted since the last call.
        periods = self._periods.advance(t)
        acted = tuple(self._commands.pieces(t - periods * self._dt, t))
        now = self._source.now(t, acted, periods)
        if self._delay:
            self._learn_delay(self._delay, t, State(*now.x))

        # The state in which the control will act, and the gates passed by then. A control that has
        # to wait for the link's next frame is planned as if it was requested then.
        ready = t + self._planning
        sent = self._commands.next_frame(ready)
        acts = sent + self._commands.latency
        x = self._when_it_acts(now, t, acts)
        target = self._gates.at(x, now.course)
        model = quadrotor(now.model, self._dt) if now.model else None
        return Estimate(
            t + (sent - ready),
            np.array(x),
            target,
            model,
            now.course,
            acts,
            measured=np.array(now.x),
            predicted=self._predicts,
        )

    def _learn_delay(self, learner: DelayLearner, t: float, x: State) -> None:
        """Learn the delay of the commands from the state x at t [s], and let them act later."""
        before = self._last
        self._last = t
        if before is None or abs(t - before - self._dt) > ON_TIME * self._dt:
            learner.interrupt()
            return
        old = learner.delay
        told = self._commands.mean(before + old, t + old)
        if learner.learn(x.body_rates, Control(*told).body_rates):
            self._commands.delay_by(learner.delay - old)
            if self.learner:
                self.learner.forget_rotors()

    def commanded(self, t: float, ready: float, u: tuple[float, ...]) -> None:
        """Record a control that is given to the vehicle.

        Args:
            t: time at which the control was requested [s].
            ready: time at which its planning ends and the control is given [s].
            u: the control  (n_u,).
        """
        self._commands.give(ready, u)
        self._planning += PLAN_TIME * (ready - t - self._planning)

    def record(self, state: PlantState) -> tuple[float, ...]:
        """Return the columns of ESTIMATE_UNITS for one frame; () if the true state is known."""
        return self._source.record(state)

    def kept(self) -> Kept | None:
        """Return the stored measurements since the last call, None if none are stored."""
        return self._source.kept()

    def _when_it_acts(self, now: Present, t: float, acts: float) -> tuple[float, ...]:
        """Return the state at `acts` [s], in which a control planned at t [s] will act.  (n_x,)

        Without a prediction the present state is returned.
        """
        if self._nominal is None or not self._predicts:
            return now.x
        model = now.model or self._nominal
        return predict(State(*now.x), self._commands, t, acts, model, longest=self._dt)


def mean(vectors: list[Vec3], weights: list[float]) -> Vec3:
    """Return the weighted mean of vectors.

    Args:
        vectors: the vectors  (n, 3).
        weights: weight of each vector  (n,).
    """
    total = sum(weights)
    x, y, z = (
        sum(w * v[k] for v, w in zip(vectors, weights, strict=True)) / total for k in range(3)
    )
    return x, y, z
