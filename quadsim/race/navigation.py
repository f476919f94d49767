"""Navigation: what the planner is told of the vehicle, in place of its true state.

    sensors -> estimator -> state now -> model under the commands given -> state in which the next control acts

Without sensors the true state takes the estimator's place, and what remains is the command latency. The estimator, the
prediction and the count of passed gates are given measurements, commands and the map alone; only the record of how far
off they are knows the truth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from quadsim.course import Course, EstimatedGate
from quadsim.physics.plant_state import PlantState
from quadsim.race.estimate_record import estimate_row
from quadsim.sensing.attitude import Vector
from quadsim.sensing.estimation.estimator import Estimator
from quadsim.sensing.estimation.nominal import Nominal
from quadsim.sensing.estimation.prediction import Commands, GateCounter, predict
from quadsim.sensing.estimation.vehicle_model import VehicleModel
from quadsim.sensing.measurements import Corners, Inertial, RotorThrust
from quadsim.sensing.sensors import Sensors
from quadsim.systems import System
from quadsim.systems.quadrotor import ModelParams, quadrotor

MOVED = 0.01  # [m] by which a gate's estimate, or its standard deviation, moves before the planner is told
PLAN_TIME = 0.1  # share of the last planning time in the mean of them


class Knowledge(Protocol):
    """What is known of the vehicle itself: its state, and the numbers of its model."""

    model: ModelParams

    def watch(self, state: PlantState) -> None:
        """The plant's state after a physics step, for sensors."""
        ...

    def now(self, t: float, acted: Vector, elapsed: int) -> Vector:
        """The state (17,) at t [s], after so many control periods under the command `acted` (4,)."""
        ...

    def record(self, state: PlantState) -> tuple[float, ...]:
        """Of a Frame: quadsim.race.estimate_record.ESTIMATE_UNITS, or nothing where the state is the true one."""
        ...


class ExactState:
    """The true state; the model is learnt of it, where the planner adapts."""

    def __init__(self, model: ModelParams, adaptation: Any, dt: float):
        """dt: control period [s]."""
        self.model, self._adaptation, self._dt = model, adaptation, dt
        self._state: PlantState | None = None
        self._t = 0.0  # [s] of the last call of `now`

    def watch(self, state: PlantState) -> None:
        self._state = state

    def now(self, t: float, acted: Vector, elapsed: int) -> Vector:
        assert self._state
        if self._adaptation:
            # No whole number of periods, where the wall clock runs and planning took longer than one.
            periods = (t - self._t) / self._dt
            periods = periods if elapsed and abs(periods - elapsed) > 1e-6 else elapsed
            self._adaptation.observe(np.array(self._state.x), np.array(acted), periods)
            self.model, self._t = self._adaptation.model, t
        return self._state.x

    def record(self, state: PlantState) -> tuple[float, ...]:
        return ()


class SensedState:
    """The state and the model by what the sensors say."""

    def __init__(
        self, sensors: Sensors, estimator: Estimator, vehicle: VehicleModel, dt: float, adapt: bool, rotor_std: float
    ):
        """dt: control period [s]. adapt: whether the planner uses what is learnt of the vehicle. rotor_std: of the
        thrust by rotor speeds [m/s^2]."""
        self._sensors, self.estimator, self.vehicle = sensors, estimator, vehicle
        self._adapt, self._dt, self._rotor_std = adapt, dt, rotor_std
        self._seen = (0, 0)
        self._inertial: list[Inertial] = []
        self.corners: Corners | None = None  # of the last picture, for display
        self.spent = 0.0  # [ms] of the last call of `now`
        self.model = vehicle.model

    def watch(self, state: PlantState) -> None:
        self._sensors.observe(state)

    def now(self, t: float, acted: Vector, elapsed: int) -> Vector:
        began = perf_counter()
        nominal, thrust = self._estimate(t)
        recent = [s for s in self._inertial if s.t > t - elapsed * self._dt + 1e-9]
        self._inertial = recent
        weights = [s.dt for s in recent]
        force = mean([nominal.force(s) for s in recent], weights) if recent and elapsed else None
        rates = nominal.rates(recent[-1]) if recent else None
        for _ in range(elapsed):
            self.vehicle.period(acted, force, rates, nominal)
        if thrust is not None:
            self.vehicle.measured(thrust, self._rotor_std)
        if self._adapt:
            self.model = self.vehicle.model
        x = (*nominal.p, *nominal.v, *nominal.q, *self.vehicle.omega, self.vehicle.thrust, *self.vehicle.beta)
        self.spent = 1e3 * (perf_counter() - began)
        return x

    def _estimate(self, t: float) -> tuple[Nominal, float | None]:
        """The state at t [s] by what has arrived; the delivered thrust, where rotor speeds were among it [m/s^2]."""
        thrust = None
        self.estimator.innovations.clear()
        for said in self._sensors.arrived(t):
            if isinstance(said, RotorThrust):
                thrust = said.thrust
                continue
            if isinstance(said, Inertial):
                self._inertial.append(said)
            elif isinstance(said, Corners):
                self.corners, self._seen = said, (said.in_view, len(said.pixels))
            self.estimator.take(said)
        self._nominal, self._t = self.estimator.at(t), t
        return self._nominal, thrust

    def record(self, state: PlantState) -> tuple[float, ...]:
        if state.t > self._t + 1e-9:  # the last frame, within a control period
            self._estimate(state.t)
        seen, self._seen = self._seen, (0, 0)
        P = self.estimator.covariance(self._t)
        return estimate_row(
            self._sensors.truth or state, self._nominal, P, self.estimator.innovations, seen, self.spent
        )


class Navigation:
    """Tells the planner the state in which its next control will act, and how many gates are passed by then."""

    def __init__(
        self,
        knowledge: Knowledge,
        commands: Commands,
        course: Course,
        laps: int,
        dt: float,
        remap: Callable[[Course], None] | None = None,
    ):
        """course: the map. remap: called with the course as it is estimated, when that has changed."""
        self.knowledge, self._commands, self._dt = knowledge, commands, dt
        self._map = self._course = course
        self._distinct = tuple(dict.fromkeys(course.gates))
        self._counter, self._remap = GateCounter(laps), remap
        self._offsets: np.ndarray | None = None  # of gates, and their standard deviations  (gates, 4)
        self._planning = 0.0  # [s] mean time of a plan

    def watch(self, state: PlantState) -> None:
        """The plant's state after a physics step."""
        self.knowledge.watch(state)

    def state(self, t: float, elapsed: int) -> tuple[np.ndarray, int]:
        """The state (17,) in which a control planned at t [s] will act, and the gates passed by then."""
        x = self.knowledge.now(t, self._commands.acting(t - elapsed * self._dt), elapsed)
        self._follow_gates()
        acts = t + self._planning + self._commands.latency
        x = predict(x, self._commands, t, acts, self.knowledge.model, self._dt)
        return np.array(x), self._counter.at(self._course, x[0:3])

    def commanded(self, t: float, ready: float, u: Vector) -> None:
        """The control u planned at t is given to the vehicle at `ready` [s]."""
        self._commands.give(ready, u)
        self._planning += PLAN_TIME * (ready - t - self._planning)

    def observe(self, x: np.ndarray, u: np.ndarray, elapsed: float) -> System:
        """The system as it is known: the planner's adaptation, see controllers.mppi.Adaptation."""
        return quadrotor(self.knowledge.model, self._dt)

    def record(self, state: PlantState) -> tuple[float, ...]:
        return self.knowledge.record(state)

    def _follow_gates(self) -> None:
        """Tell the planner where gates stand by the estimate, and how certain that is, once one has moved."""
        estimator = getattr(self.knowledge, "estimator", None)
        if not (self._remap and estimator is not None):
            return
        belief, gates = estimator.belief, len(self._distinct)
        moves = belief.gates if len(belief.gates) else np.zeros((gates, 3))
        now = np.column_stack([moves, belief.gate_std(gates)])
        if self._offsets is not None and abs(now - self._offsets).max() < MOVED:
            return
        self._offsets = now
        rows = zip(self._distinct, now.tolist(), strict=True)
        moved = {gate: EstimatedGate.of(gate, (x, y, z), std) for gate, (x, y, z, std) in rows}
        self._course = replace(self._map, gates=tuple(moved[g] for g in self._map.gates))
        self._remap(self._course)


def mean(vectors: list[Vector], weights: list[float]) -> Vector:
    """Weighted, of vectors of three numbers."""
    total = sum(weights)
    return tuple(sum(w * v[k] for v, w in zip(vectors, weights, strict=True)) / total for k in range(3))
