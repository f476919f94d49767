"""simulate(): the loop in which the controller plans, the plant steps and the referee checks; one
Frame per step.

It is a generator: the consumer sets the pace. The command line collects the frames, the web page
draws them as they come and pauses by not asking for the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from time import perf_counter
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from controllers.plan import PlannerSnapshot, PlanStats
from quadsim.dynamics.estimate import Estimate
from quadsim.physics.plant import Plant, PlantState
from quadsim.race.clock import Clock
from quadsim.race.events import Event, Frame
from quadsim.rotation import Vec3
from quadsim.sensing.estimation.prediction import Commands
from quadsim.sensing.navigation import Navigation, RefereeCount, TrueState


@runtime_checkable
class Controller(Protocol):
    """Computes the next control from what is known of the vehicle. MPPI is one."""

    @property
    def rest(self) -> np.ndarray:
        """The control at rest, of a quadrotor hover; applied until the first plan is ready.
        (n_u,)"""
        ...

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the control to apply, and statistics of the plan.

        Args:
            estimate: time, state and gates passed; the model and the course, where they are
                estimated in flight.

        Returns:
            u (n_u,) and PlanStats.
        """
        ...


class ControlLaw(Protocol):
    """A controller of one's own in its plainest form."""

    def control(self, x: np.ndarray, /) -> ArrayLike:
        """Return the control u (n_u,) at the state x (n_x,)."""
        ...


class PlainController:
    """Adapts a controller that has only `control(x) -> u` to the Controller protocol."""

    def __init__(self, inner: ControlLaw, rest: Sequence[float]):
        """rest: the control until the first one is ready  (n_u,)."""
        self._inner = inner
        self.rest = np.array(rest)

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        u = np.asarray(self._inner.control(estimate.x), float)
        return u, PlanStats(cost=0.0, ess=0.0, temperature=0.0)


class RefereeProtocol(Protocol):
    """Checks every physics step and ends the flight by setting an outcome; see
    quadsim.race.referee.Referee."""

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

    def observe(
        self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()
    ) -> list[Event]:
        """Events of the physics step from p0 at t0 to p1 at t1 [m, s]. contacts: objects that the
        vehicle touches."""
        ...


SNAPSHOT_EVERY = 10  # control periods from one PlannerSnapshot to the next


def simulate(
    plant: Plant,
    controller: Controller,
    referee: RefereeProtocol,
    period: float,
    clock: Clock | None = None,
    snapshot: Callable[[], PlannerSnapshot | None] | None = None,
    navigation: Navigation | None = None,
) -> Iterator[Frame]:
    """Simulate until the referee ends the flight. The last frame has the outcome and the last
    control applied.

    With the wall clock, the previous control is applied until the new plan is ready; the next
    planning step starts one period after this one started, or when this plan is ready if that is
    later. With the default clock, planning takes no simulated time.

    Args:
        plant, controller, referee: used for this one flight.
        period: control period [s], a whole multiple of the plant's step.
        clock: default: simulated time.
        snapshot: called every SNAPSHOT_EVERY periods; the result is stored in the frame.
        navigation: makes the estimate that the controller is given; default: of the true state and
            the referee's count.

    Raises:
        ValueError: period is no whole multiple of the plant's step.
    """
    clock = clock or Clock()
    whole_multiple(period, plant.dt)
    began = perf_counter()
    u = previous_u = tuple(controller.rest.tolist())
    navigation = navigation or exact_navigation(plant.state, referee, u, period)
    stats, plan_ms = PlanStats(cost=0.0, ess=0.0, temperature=0.0), 0.0
    events: list[Event] = []
    for k in count():
        state, flying = plant.state, referee.outcome is None
        if flying:
            before = perf_counter()
            control, stats = controller.control(navigation.estimate(state.t))
            plan_ms = 1e3 * (perf_counter() - before)
            previous_u, u = u, tuple(control.tolist())
        # read before the frame is yielded, as its consumer may take a while
        plan_ready_time = clock.now(state.t)
        best = snapshot() if snapshot and flying and k % SNAPSHOT_EVERY == 0 else None
        navigation.commanded(state.t, plan_ready_time, u)
        yield frame(
            state,
            u,
            referee,
            stats,
            plan_ms=plan_ms,
            elapsed=perf_counter() - began,
            estimate=navigation.record(state),
            events=tuple(events),
            snapshot=best,
        )
        if not flying:
            return
        events = apply_control(plant, referee, previous_u, plan_ready_time, navigation)
        # later if the plan took more than a period
        next_time = max(state.t + period, plant.state.t)
        clock.wait(next_time)
        events += apply_control(plant, referee, u, next_time, navigation)


def exact_navigation(
    state: PlantState, referee: RefereeProtocol, rest: tuple[float, ...], dt: float
) -> Navigation:
    """Return the navigation that knows the true state and the referee's count, without an estimate
    of anything else.

    Args:
        state: the plant's at the start.
        rest: the control until the first one is given  (n_u,).
        dt: control period [s].
    """
    return Navigation(
        TrueState(state, dt), RefereeCount(referee), Commands(rest, 0.0), dt, nominal=None
    )


def frame(
    state: PlantState, u: tuple[float, ...], referee: RefereeProtocol, stats: PlanStats, **more: Any
) -> Frame:
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
    navigation: Navigation | None = None,
) -> list[Event]:
    """Step the plant under u to the physics step nearest to the time `until` [s]; the referee
    checks every step, and sensors watch it."""
    events: list[Event] = []
    while plant.state.t < until - plant.dt / 2 and referee.outcome is None:
        before = plant.state
        after = plant.step(u)
        if navigation:
            navigation.watch(after)
        events += referee.observe(
            before.t, before.position, after.t, after.position, after.contacts
        )
    return events


def whole_multiple(period: float, dt: float) -> int:
    """Number of physics steps of dt in a control period. Raises ValueError unless it is a whole
    number."""
    substeps = round(period / dt)
    if substeps < 1 or abs(substeps * dt - period) > 1e-9:
        raise ValueError(
            f"dt: expected a whole multiple of the plant's step {dt:g} [s], got {period:g}"
        )
    return substeps
