"""Navigation: what is known of the vehicle, as the Estimate that its controller plans with.

    sensors -> estimator -> state now -> model under the commands given -> state in which the next
    control acts

A Navigation is put together from three parts:

* a source of the present state: the true one (TrueState), or an estimator's (SensedState);
* the commands given so far, under which the model predicts how the vehicle moves until the next one
  acts;
* a count of the gates passed: the referee's (RefereeCount), or one by the estimated path
  (GateCounter).

The estimator, the prediction and the count by the path are given measurements, commands and the map
alone; only the record of how far off they are knows the truth.
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import NamedTuple, Protocol

import numpy as np

from quadsim.course import Course, EstimatedGate, Gate
from quadsim.dynamics.control_periods import ControlPeriods
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import Vec3
from quadsim.sensing.estimate_record import estimate_row
from quadsim.sensing.estimation.body_rates import BodyRates
from quadsim.sensing.estimation.error_state import FilterState
from quadsim.sensing.estimation.estimator import Estimator
from quadsim.sensing.estimation.prediction import Commands, predict
from quadsim.sensing.estimation.vehicle_learner import VehicleLearner
from quadsim.sensing.measurements import Corners, Inertial, RotorThrust
from quadsim.sensing.sensors import Sensors

# [m] by which a gate's estimate, or its standard deviation, moves before the course is a new one
MOVED = 0.01
PLAN_TIME = 0.1  # weight of the last planning time in the mean of them
WHOLE = 1e-6  # of a period: a number of periods this near to a whole one is taken for it


class Present(NamedTuple):
    """The present state, with the model and the course as they are estimated."""

    x: tuple[float, ...]  # state now, of a quadrotor a State  (n_x,)
    model: ModelParams | None = None  # as it is estimated; None: nothing is learnt of it
    course: Course | None = None  # as it is estimated; None: the map is all that is known


class PictureCount(NamedTuple):
    """Corners of the last picture."""

    in_view: int  # that stood in it
    found: int  # that were found in it


class StateSource(Protocol):
    """A source of the present state."""

    @property
    def corners(self) -> Corners | None:
        """Corners of gates found in the last picture, for display; None without a camera."""
        ...

    @property
    def learner(self) -> VehicleLearner | None:
        """What is learnt of the vehicle's numbers, for display; None: nothing."""
        ...

    def watch(self, state: PlantState) -> None:
        """Note the plant's state after a physics step."""
        ...

    def now(self, t: float, acted: tuple[float, ...], periods: int) -> Present:
        """Return what is known at t [s], after so many control periods under the command `acted`
        (n_u,)."""
        ...

    def record(self, state: PlantState) -> tuple[float, ...]:
        """Return the columns of ESTIMATE_UNITS for this true state, or nothing where the true state
        is known."""
        ...


class GateCount(Protocol):
    """A count of the passed gates, as it is known on board."""

    def at(self, x: tuple[float, ...], course: Course | None) -> int:
        """Return the gates passed when the vehicle is in the state x.

        Args:
            x: state, which begins with the position [m]  (n_x,).
            course: as it is estimated; None: the map.
        """
        ...


class PassedGates(Protocol):
    """Something that counts gates by the truth, such as a referee."""

    @property
    def passed(self) -> int: ...


class RefereeCount:
    """The true number of gates passed, by the referee."""

    def __init__(self, referee: PassedGates):
        self._referee = referee

    def at(self, x: tuple[float, ...], course: Course | None) -> int:
        return self._referee.passed


class TrueState:
    """The plant's true state, and what can be learnt of the vehicle from it."""

    corners = None

    def __init__(self, state: PlantState, dt: float, learner: VehicleLearner | None = None):
        """Start at the plant's first state.

        Args:
            dt: control period [s].
            learner: of the vehicle's numbers, for exact states; None: they are not estimated.
        """
        self._state, self._dt = state, dt
        self.learner = learner
        self._before: PlantState | None = None  # at the last call of `now`

    def watch(self, state: PlantState) -> None:
        self._state = state

    def now(self, t: float, acted: tuple[float, ...], periods: int) -> Present:
        before, self._before = self._before, self._state
        if self.learner is None:
            return Present(self._state.x)
        if before is not None and periods:
            duration = self._whole_periods(t - before.t) * self._dt
            self.learner.learn_from_states(
                State(*before.x), State(*self._state.x), Control(*acted), duration
            )
        return Present(self._state.x, self.learner.model)

    def record(self, state: PlantState) -> tuple[float, ...]:
        return ()

    def _whole_periods(self, duration: float) -> float:
        """Control periods in a duration [s]; no whole number of them where planning took longer on
        the wall clock."""
        periods = duration / self._dt
        return round(periods) if abs(periods - round(periods)) <= WHOLE else periods


class SensedState:
    """The state, the vehicle's numbers and the course, estimated from what the sensors measure."""

    def __init__(
        self,
        sensors: Sensors,
        estimator: Estimator,
        body_rates: BodyRates,
        learner: VehicleLearner,
        course: CourseEstimate | None,
        dt: float,
        adapt: bool,
        rotor_std: float,
    ):
        """Put the sensors and what is estimated from them together.

        Args:
            sensors: warmed up, at the flight's first state.
            estimator: of position, velocity and attitude, and of where gates stand.
            body_rates: observes the rates and the angular accelerations.
            learner: of the thrust and the vehicle's numbers, for sensors.
            course: as it is estimated; None: for a controller that flies by the map.
            dt: control period [s].
            adapt: whether the planner uses what is learnt of the vehicle.
            rotor_std: standard deviation of the thrust by rotor speeds [m/s^2].
        """
        self._sensors, self._estimator = sensors, estimator
        self._body_rates, self.learner, self._course = body_rates, learner, course
        self._dt, self._adapt, self._rotor_std = dt, adapt, rotor_std
        self._inertial: list[Inertial] = []  # samples of the present period
        self._rotors: RotorThrust | None = None  # the last measurement since the last estimate
        self.corners: Corners | None = None
        self._picture = PictureCount(0, 0)
        self._nominal = estimator.state.nominal  # at the last estimate
        self._t = self._nominal.t  # of the last estimate [s]
        self._spent = 0.0  # time that the last call of `now` took [ms]

    def watch(self, state: PlantState) -> None:
        self._sensors.observe(state)

    def now(self, t: float, acted: tuple[float, ...], periods: int) -> Present:
        began = perf_counter()
        self._take_measurements(t)
        nominal = self._nominal
        self._follow_vehicle(t, Control(*acted), periods)
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
        if state.t > self._t + 1e-9:  # the last frame, within a control period
            self._take_measurements(state.t)
        picture, self._picture = self._picture, PictureCount(0, 0)
        return estimate_row(
            self._sensors.truth or state,
            self._nominal,
            self._estimator.covariance(self._t),
            self._estimator.innovations,
            picture,
            self._spent,
        )

    def _take_measurements(self, t: float) -> None:
        """Bring position, velocity and attitude to t [s] by what has arrived, and keep what else
        was measured."""
        self._rotors = None
        self._estimator.innovations.clear()
        for measurement in self._sensors.arrived(t):
            match measurement:
                case RotorThrust():
                    self._rotors = measurement
                    continue
                case Inertial():
                    self._inertial.append(measurement)
                case Corners():
                    self.corners = measurement
                    self._picture = PictureCount(measurement.in_view, len(measurement.pixels))
            self._estimator.take(measurement)
        self._nominal, self._t = self._estimator.at(t), t

    def _follow_vehicle(self, t: float, u: Control, periods: int) -> None:
        """Bring body rates, thrust and the vehicle's numbers to t [s], so many control periods
        under the command u."""
        nominal = self._nominal
        recent = [s for s in self._inertial if s.t > t - periods * self._dt + 1e-9]
        self._inertial = recent
        force = rates = None
        if recent:
            rates = nominal.rates(recent[-1])
            force = mean([nominal.force(s) for s in recent], [s.dt for s in recent])
        for _ in range(periods):
            reserve = self._body_rates.reserve(u)
            self._body_rates.advance(u, rates)
            reserve = max(reserve, self._body_rates.reserve(u))
            self.learner.learn_from_force(u.thrust, reserve, force, nominal)


class CourseEstimate:
    """The course with its gates where the estimator has them, and how certain that is."""

    def __init__(self, course: Course):
        """course: the map."""
        self._map = self._course = course
        self._distinct: tuple[Gate, ...] = tuple(dict.fromkeys(course.gates))
        # of gates, and their standard deviations [m]  (gates, 4)
        self._offsets: np.ndarray | None = None

    def updated(self, state: FilterState) -> Course:
        """Return the course by this state of the filter: the same object as before until a gate has
        MOVED."""
        gates = len(self._distinct)
        moves = state.gates if len(state.gates) else np.zeros((gates, 3))
        offsets = np.column_stack([moves, state.gate_std(gates)])
        if self._offsets is not None and abs(offsets - self._offsets).max() < MOVED:
            return self._course
        self._offsets = offsets
        rows = zip(self._distinct, offsets.tolist(), strict=True)
        moved = {gate: EstimatedGate.of(gate, (x, y, z), std) for gate, (x, y, z, std) in rows}
        self._course = replace(self._map, gates=tuple(moved[gate] for gate in self._map.gates))
        return self._course


class Navigation:
    """Makes the Estimate that a controller is given, once each control period."""

    def __init__(
        self,
        source: StateSource,
        gates: GateCount,
        commands: Commands,
        dt: float,
        nominal: ModelParams | None,
    ):
        """Put the parts together.

        Args:
            source: of the present state.
            gates: counts the gates passed.
            commands: given before the flight.
            dt: control period [s].
            nominal: the model that predicts until the next control acts, where none is estimated;
                None: a system for which that is not predicted.
        """
        self._source, self._gates, self._commands = source, gates, commands
        self._dt, self._nominal = dt, nominal
        self._periods = ControlPeriods(dt)
        self._planning = 0.0  # [s] mean time of a plan

    @property
    def corners(self) -> Corners | None:
        """Corners of gates found in the last picture, for display; None without a camera."""
        return self._source.corners

    @property
    def learner(self) -> VehicleLearner | None:
        """What is learnt of the vehicle's numbers, for display; None: nothing."""
        return self._source.learner

    def watch(self, state: PlantState) -> None:
        """Note the plant's state after a physics step."""
        self._source.watch(state)

    def estimate(self, t: float) -> Estimate:
        """Return what is known when a control is asked for at t [s]."""
        periods = self._periods.advance(t)
        acted = self._commands.acting(t - periods * self._dt)
        now = self._source.now(t, acted, periods)
        x = self._when_it_acts(now, t)
        target = self._gates.at(x, now.course)
        model = quadrotor(now.model, self._dt) if now.model else None
        return Estimate(t, np.array(x), target, model, now.course)

    def commanded(self, t: float, ready: float, u: tuple[float, ...]) -> None:
        """Note that the control u (n_u,), planned at t [s], is given to the vehicle at `ready`
        [s]."""
        self._commands.give(ready, u)
        self._planning += PLAN_TIME * (ready - t - self._planning)

    def record(self, state: PlantState) -> tuple[float, ...]:
        """Return the columns of quadsim.sensing.estimate_record.ESTIMATE_UNITS for one frame, or
        nothing."""
        return self._source.record(state)

    def _when_it_acts(self, now: Present, t: float) -> tuple[float, ...]:
        """The state in which a control planned at t [s] will act.  (n_x,)"""
        if self._nominal is None:
            return now.x
        acts = t + self._planning + self._commands.latency
        return predict(State(*now.x), self._commands, t, acts, now.model or self._nominal, self._dt)


def mean(vectors: list[Vec3], weights: list[float]) -> Vec3:
    """Return the weighted mean of vectors."""
    total = sum(weights)
    x, y, z = (
        sum(w * v[k] for v, w in zip(vectors, weights, strict=True)) / total for k in range(3)
    )
    return x, y, z
