"""fly(): the one loop. The controller plans, the plant moves, the referee watches; each control step is a Frame.

A generator, so that whoever asks for frames sets the pace: the command line collects them, a page draws
while it asks, a test takes them all, and pausing is not asking for the next one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from time import perf_counter
from typing import Protocol

import numpy as np

from controllers.plan import PlannerSnapshot, PlanStats
from quadsim.course import Vec3
from quadsim.physics.plant import Plant
from quadsim.race.clock import Clock, SimulatedClock
from quadsim.race.events import Event, Frame


class Controller(Protocol):
    """Chooses u at state x on the way to gate number `target` (gates passed since the start).

    `elapsed` control periods have passed since it was last asked, 0 the first time.
    """

    @property
    def rest(self) -> np.ndarray:
        """The control that holds still, for the time before there is a plan.  (n_u,)"""
        ...

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]: ...


class RefereeProtocol(Protocol):
    """Watches every physics step until it has an outcome; see quadsim.race.referee.Referee."""

    @property
    def outcome(self) -> str | None: ...
    @property
    def passed(self) -> int: ...
    @property
    def lap(self) -> int: ...
    @property
    def next_gate(self) -> int: ...
    def observe(self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()) -> list[Event]: ...


SNAPSHOT_EVERY = 10  # control periods from one picture of the planner to the next


def fly(
    plant: Plant,
    controller: Controller,
    referee: RefereeProtocol,
    period: float,
    clock: Clock | None = None,
    picture: Callable[[], PlannerSnapshot | None] | None = None,
) -> Iterator[Frame]:
    """Fly until the referee ends it. The last frame carries the outcome and the control that led there.

    period: control period [s], a whole multiple of the plant's step; raises ValueError otherwise.
    A plan made from the state at t acts when it is ready, until then the control before it does; the next
    plan begins one period after t, or when this one is ready. By default that is at once.
    picture: asked now and then for what the planner thinks, to be kept with the run.
    """
    clock = clock or SimulatedClock()
    whole_multiple(period, plant.dt)
    began = perf_counter()
    u = held = tuple(controller.rest.tolist())
    stats, plan_ms, elapsed, asked, events = None, 0.0, 0, 0, []
    while True:
        state = plant.state
        if referee.outcome is None:
            held, (u, stats, plan_ms) = u, _planned(controller, state.x, referee.passed, elapsed)
        ready = clock.now(state.t)  # before anybody looks at the frame
        assert stats is not None
        seen = picture() if picture and referee.outcome is None and asked % SNAPSHOT_EVERY == 0 else None
        asked += 1
        yield Frame(
            t=state.t,
            x=state.x,
            u=u,
            passed=referee.passed,
            lap=referee.lap,
            gate=referee.next_gate + 1,
            ess=stats.ess,
            temperature=stats.temperature,
            cost=stats.cost,
            plan_ms=plan_ms,
            elapsed=perf_counter() - began,
            events=tuple(events),
            outcome=referee.outcome,
            picture=seen,
        )
        if referee.outcome is not None:
            return
        events, elapsed = _advance(plant, referee, clock, held, ready, u, period)


def _planned(
    controller: Controller, x: tuple[float, ...], target: int, elapsed: int
) -> tuple[tuple[float, ...], PlanStats, float]:
    """The control at x, what the controller says of its plan, and how long it took [ms]."""
    before = perf_counter()
    control, stats = controller.control(np.array(x), target, elapsed)
    return tuple(control.tolist()), stats, 1e3 * (perf_counter() - before)


def _advance(
    plant: Plant,
    referee: RefereeProtocol,
    clock: Clock,
    held: tuple[float, ...],
    ready: float,
    u: tuple[float, ...],
    period: float,
) -> tuple[list[Event], int]:
    """Apply the held control until the plan is ready, then u until the next plan begins: events, periods passed."""
    t = plant.state.t
    events = hold(plant, referee, held, ready)
    following = max(t + period, plant.state.t)
    clock.wait(following)
    events += hold(plant, referee, u, following)
    return events, max(round((following - t) / period), 1)


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
