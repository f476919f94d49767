"""fly(): the one loop. The controller plans, the plant moves, the referee judges; each control step is a Frame.

A generator, so that whoever asks for frames sets the pace: the command line collects them, a page draws
while it asks, a test takes them all, and pausing is not asking for the next one.
"""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter
from typing import Protocol

import numpy as np

from quadsim.plant import Plant
from quadsim.referee import Referee
from quadsim.run import Event, Frame


class PlanStats(Protocol):
    """What a controller says about its last plan; see controllers.mppi.PlanStats."""

    @property
    def cost(self) -> float: ...
    @property
    def ess(self) -> float: ...
    @property
    def temperature(self) -> float: ...


class Controller(Protocol):
    """Chooses u at state x on the way to gate number `target` (gates passed since the start)."""

    def control(self, x: np.ndarray, target: int = 0, elapsed: int = 1) -> tuple[np.ndarray, PlanStats]: ...


def fly(plant: Plant, controller: Controller, referee: Referee, period: float) -> Iterator[Frame]:
    """Fly until the referee ends it. The last frame carries the outcome and the control that led there.

    period: control period [s], a whole multiple of the plant's step; raises ValueError otherwise.
    """
    substeps = whole_multiple(period, plant.dt)
    began = perf_counter()
    u, stats, plan_ms = (0.0,) * 4, None, 0.0
    events: list[Event] = []
    while True:
        state = plant.state
        if referee.outcome is None:
            before = perf_counter()
            control, stats = controller.control(np.array(state.x), referee.passed)
            plan_ms = 1e3 * (perf_counter() - before)
            u = tuple(control.tolist())
        assert stats is not None
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
        )
        if referee.outcome is not None:
            return
        events = hold(plant, referee, u, substeps)


def hold(plant: Plant, referee: Referee, u: tuple[float, ...], substeps: int) -> list[Event]:
    """Apply u for one control period, every physics step judged."""
    events: list[Event] = []
    for _ in range(substeps):
        before = plant.state
        after = plant.step(u)
        events += referee.observe(before.t, before.x[:3], after.t, after.x[:3], after.contacts)
        if referee.outcome is not None:
            break
    return events


def whole_multiple(period: float, dt: float) -> int:
    substeps = round(period / dt)
    if substeps < 1 or abs(substeps * dt - period) > 1e-9:
        raise ValueError(f"dt: expected a whole multiple of the plant's step {dt:g} [s], got {period:g}")
    return substeps
