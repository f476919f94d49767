"""simulate(): the loop in which the controller plans, the plant steps and the referee checks; one Frame per step.

It is a generator: the consumer sets the pace. The command line collects the frames, the web page draws them as they
come and pauses by not asking for the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from controllers.plan import PlannerSnapshot, PlanStats
from quadsim.physics.plant import Plant, PlantState
from quadsim.race.clock import Clock
from quadsim.race.events import Event, Frame
from quadsim.rotation import Vec3


class Controller(Protocol):
    """Computes the control u at the state x. MPPI is one."""

    @property
    def rest(self) -> np.ndarray:
        """The control at rest, of a quadrotor hover; applied until the first plan is ready.  (n_u,)"""
        ...

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]:
        """The control to apply at the state x, and statistics of the plan.

        Args:
            x: (n_x,)
            target: index into the sequence of gates over all laps, from 0; equals the gates passed since the start.
            elapsed: control periods since the last call, 0 at the first.

        Returns:
            u (n_u,) and PlanStats.
        """
        ...


class PlainController:
    """Adapts a user's controller that has only `control(x) -> u` to the Controller protocol."""

    def __init__(self, inner: Any, rest: Sequence[float]):
        self._inner, self.rest = inner, np.array(rest)

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]:
        return np.asarray(self._inner.control(x), float), PlanStats(cost=0.0, ess=0.0, temperature=0.0)


class RefereeProtocol(Protocol):
    """Checks every physics step and ends the flight by setting an outcome; see quadsim.race.referee.Referee."""

    @property
    def outcome(self) -> str | None:
        """None while the flight goes on."""
        ...

    @property
    def passed(self) -> int:
        """Gates passed since the start."""
        ...

    @property
    def lap(self) -> int:
        """The current lap, from 1."""
        ...

    @property
    def next_gate(self) -> int:
        """Index of the next gate, from 0."""
        ...

    def observe(self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()) -> list[Event]:
        """Events of the physics step from p0 at t0 to p1 at t1 [m, s]. contacts: objects that the vehicle touches."""
        ...


class NavigationProtocol(Protocol):
    """Tells the controller what is known of the vehicle; see quadsim.race.navigation.Navigation."""

    def watch(self, state: PlantState) -> None: ...
    def state(self, t: float, elapsed: int) -> tuple[np.ndarray, int]: ...
    def commanded(self, t: float, ready: float, u: tuple[float, ...]) -> None: ...
    def record(self, state: PlantState) -> tuple[float, ...]: ...


SNAPSHOT_EVERY = 10  # control periods from one PlannerSnapshot to the next


def simulate(
    plant: Plant,
    controller: Controller,
    referee: RefereeProtocol,
    period: float,
    clock: Clock | None = None,
    snapshot: Callable[[], PlannerSnapshot | None] | None = None,
    navigation: NavigationProtocol | None = None,
) -> Iterator[Frame]:
    """Simulate until the referee ends the flight. The last frame has the outcome and the last control applied.

    With the wall clock, the previous control is applied until the new plan is ready; the next planning step starts one
    period after this one started, or when this plan is ready if that is later. With the default clock, planning takes
    no simulated time.

    Args:
        plant, controller, referee: used for this one flight.
        period: control period [s], a whole multiple of the plant's step.
        clock: default: simulated time.
        snapshot: called every SNAPSHOT_EVERY periods; the result is stored in the frame.
        navigation: tells the controller the state; default: the true one, and the gates that the referee counts.

    Raises:
        ValueError: period is no whole multiple of the plant's step.
    """
    clock = clock or Clock()
    whole_multiple(period, plant.dt)
    began = perf_counter()
    u = previous_u = tuple(controller.rest.tolist())
    stats, plan_ms, elapsed = PlanStats(cost=0.0, ess=0.0, temperature=0.0), 0.0, 0
    events: list[Event] = []
    for k in count():
        state, flying = plant.state, referee.outcome is None
        if flying:
            before = perf_counter()
            x, target = navigation.state(state.t, elapsed) if navigation else (np.array(state.x), referee.passed)
            control, stats = controller.control(x, target, elapsed)
            plan_ms = 1e3 * (perf_counter() - before)
            previous_u, u = u, tuple(control.tolist())
        plan_ready_time = clock.now(state.t)  # read before the frame is yielded, as its consumer may take a while
        best = snapshot() if snapshot and flying and k % SNAPSHOT_EVERY == 0 else None
        wall: dict[str, Any] = {"plan_ms": plan_ms, "elapsed": perf_counter() - began}
        if navigation:
            navigation.commanded(state.t, plan_ready_time, u)
            wall["estimate"] = navigation.record(state)
        yield frame(state, u, referee, stats, **wall, events=tuple(events), snapshot=best)
        if not flying:
            return
        events = apply_control(plant, referee, previous_u, plan_ready_time, navigation)
        next_time = max(state.t + period, plant.state.t)  # later if the plan took more than a period
        clock.wait(next_time)
        events += apply_control(plant, referee, u, next_time, navigation)
        elapsed = max(round(next_time / period) - round(state.t / period), 1)  # late plans add up to whole periods


def frame(state: PlantState, u: tuple[float, ...], referee: RefereeProtocol, stats: PlanStats, **more: Any) -> Frame:
    """The Frame of this state and control; `more`: its other fields."""
    return Frame(
        t=state.t,
        x=state.x,
        u=u,
        passed=referee.passed,
        lap=referee.lap,
        gate=referee.next_gate + 1,
        ess=stats.ess,
        temperature=stats.temperature,
        cost=stats.cost,
        outcome=referee.outcome,
        **more,
    )


def apply_control(
    plant: Plant,
    referee: RefereeProtocol,
    u: tuple[float, ...],
    until: float,
    navigation: NavigationProtocol | None = None,
) -> list[Event]:
    """Step the plant under u to the physics step nearest to the time `until` [s]; the referee checks every step, and
    sensors watch it."""
    events: list[Event] = []
    while plant.state.t < until - plant.dt / 2 and referee.outcome is None:
        before = plant.state
        after = plant.step(u)
        if navigation:
            navigation.watch(after)
        events += referee.observe(before.t, before.position, after.t, after.position, after.contacts)
    return events


def whole_multiple(period: float, dt: float) -> int:
    """Number of physics steps of dt in a control period. Raises ValueError unless it is a whole number."""
    substeps = round(period / dt)
    if substeps < 1 or abs(substeps * dt - period) > 1e-9:
        raise ValueError(f"dt: expected a whole multiple of the plant's step {dt:g} [s], got {period:g}")
    return substeps
