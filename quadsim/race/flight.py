"""fly(): the one loop. The controller plans, the plant moves, the referee watches; each control step is a Frame.

A generator, so that whoever asks for frames sets the pace: the command line collects them, a page draws
while it asks, a test takes them all, and pausing is not asking for the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from controllers.plan import PlannerSnapshot, PlanStats
from quadsim.course import Vec3
from quadsim.physics.plant import Plant
from quadsim.race.clock import Clock
from quadsim.race.events import Event, Frame


class Controller(Protocol):
    """Chooses u at state x on the way to gate number `target` (gates passed since the start).

    `elapsed` control periods have passed since it was last asked, 0 the first time.
    """

    @property
    def rest(self) -> np.ndarray:
        """The control that holds still, for the time before there is a plan.  (n_u,)"""
        ...

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]:
        """The control (n_u,) to apply at the state x (n_x,), and what is to be reported of the plan."""
        ...


class PlainController:
    """A user's controller that has nothing but `control(x) -> u`, as a Controller."""

    def __init__(self, inner: Any, rest: Sequence[float]):
        self._inner, self.rest = inner, np.array(rest)

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]:
        return np.asarray(self._inner.control(x), float), PlanStats(cost=0.0, ess=0.0, temperature=0.0)


class RefereeProtocol(Protocol):
    """Watches every physics step until it has an outcome; see quadsim.race.referee.Referee."""

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
        """What happened in the physics step from p0 at t0 to p1 at t1 [m, s]. contacts: what the plant touched."""
        ...


SNAPSHOT_EVERY = 10  # control periods from one PlannerSnapshot to the next


def fly(
    plant: Plant,
    controller: Controller,
    referee: RefereeProtocol,
    period: float,
    clock: Clock | None = None,
    snapshot: Callable[[], PlannerSnapshot | None] | None = None,
) -> Iterator[Frame]:
    """Fly until the referee ends it. The last frame carries the outcome and the control that led there.

    period: control period [s], a whole multiple of the plant's step; raises ValueError otherwise.
    A plan made from the state at t acts when it is ready, until then the control before it does; the next
    plan begins one period after t, or when this one is ready. By default that is at once.
    snapshot: asked every SNAPSHOT_EVERY periods for the planner's best sampled paths, which are kept with the run.
    """
    clock = clock or Clock()
    whole_multiple(period, plant.dt)
    began = perf_counter()
    u = held = tuple(controller.rest.tolist())
    plan, elapsed = (0.0, 0.0, 0.0, 0.0), 0
    events: list[Event] = []
    for k in count():
        state = plant.state
        if referee.outcome is None:
            before = perf_counter()
            control, stats = controller.control(np.array(state.x), referee.passed, elapsed)
            plan = stats.ess, stats.temperature, stats.cost, 1e3 * (perf_counter() - before)
            held, u = u, tuple(control.tolist())
        ready = clock.now(state.t)  # before the frame is handed out, which may take a while
        seen = snapshot() if snapshot and referee.outcome is None and k % SNAPSHOT_EVERY == 0 else None
        progress = referee.passed, referee.lap, referee.next_gate + 1
        seconds = perf_counter() - began
        yield Frame(state.t, state.x, u, *progress, *plan, seconds, tuple(events), referee.outcome, seen)
        if referee.outcome is not None:
            return
        events = hold(plant, referee, held, ready)
        following = max(state.t + period, plant.state.t)
        clock.wait(following)
        events += hold(plant, referee, u, following)
        elapsed = max(round((following - state.t) / period), 1)


def hold(plant: Plant, referee: RefereeProtocol, u: tuple[float, ...], until: float) -> list[Event]:
    """Apply u until the given time, to the nearest physics step; the referee sees every step."""
    events: list[Event] = []
    while plant.state.t < until - plant.dt / 2 and referee.outcome is None:
        before = plant.state
        after = plant.step(u)
        events += referee.observe(before.t, before.position, after.t, after.position, after.contacts)
    return events


def whole_multiple(period: float, dt: float) -> int:
    """How many physics steps of dt make a control period. Raises ValueError unless it is a whole number."""
    substeps = round(period / dt)
    if substeps < 1 or abs(substeps * dt - period) > 1e-9:
        raise ValueError(f"dt: expected a whole multiple of the plant's step {dt:g} [s], got {period:g}")
    return substeps
