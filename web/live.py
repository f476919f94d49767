"""A flight in the worker's hands: its trace as it grows, its run when it ends."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from quadsim.race.events import Event, Frame, flown_laps, lap_penalties
from quadsim.record.archive import RunFolder
from quadsim.record.planner_snapshot import PlannerSnapshots
from quadsim.record.run import COLUMNS, INTERACTIVE, Recorder, Run
from web.choices import Flight, Numbers
from web.competitor import Competitor
from web.progress import Legs

if TYPE_CHECKING:
    from controllers.sampled_trajectories import SampledTrajectories


class Trace:
    """A table that grows a row a frame; views of it stay valid."""

    def __init__(self, legs: Legs):
        self._legs, self._n = legs, 0
        self._table = np.empty((1024, len(COLUMNS) + 1))

    def append(self, f: Frame) -> None:
        if self._n == len(self._table):
            self._table = np.vstack([self._table, np.empty_like(self._table)])
        along = self._legs.progress(np.array([f.x[:3]]), np.array([f.passed]))[0]
        before = self._table[self._n - 1, -1] if self._n else 0.0
        numbers = (f.passed, f.lap, f.ess, f.temperature, f.cost, f.plan_ms)
        self._table[self._n] = (f.t, *f.x, *f.u, *numbers, max(along, before))
        self._n += 1

    def view(self) -> tuple[dict[str, np.ndarray], np.ndarray]:
        rows = self._table[: self._n]
        return {name: rows[:, i] for i, name in enumerate(COLUMNS)}, rows[:, -1]


class LiveCompetitor:
    """A flight in the worker's hands: advanced frame by frame, kept in a run folder when it ends."""

    def __init__(self, flight: Flight, root: str, name: str):
        self.flight, self.name = flight, name
        self.spec = dict(flight.spec)
        self.legs = Legs(flight.course, self.spec["laps"])
        self._folder = RunFolder.open(root, self.spec)
        self._trace, self._recorder = Trace(self.legs), Recorder()
        self.outcome: str | None = None
        self.sampled_trajectories: SampledTrajectories | None = None
        self._pictures: PlannerSnapshots | None = None
        self._kept: Path | None = None

    @property
    def t(self) -> float:
        """Of the last frame [s]; before the first, one period before the start."""
        return self._recorder.last.t if self._recorder.last else -self.flight.period

    def advance(self) -> Frame:
        """Plan, fly one period. The last frame of a flight carries its outcome."""
        frame = next(self.flight.frames)
        self._recorder.add(frame)
        self._trace.append(frame)
        self.outcome = frame.outcome
        return frame

    @property
    def laps(self) -> tuple[float, ...]:
        return _laps(self._recorder.events, self.legs.gates)

    def look(self) -> None:
        self.sampled_trajectories = self.flight.sampled_trajectories()

    def tune(self, numbers: Numbers, changes: list[dict]) -> None:
        self.flight.tune(numbers)
        now = {"t": max(self.t, 0.0)}
        made = [*self.spec.get(INTERACTIVE, []), *(now | change for change in changes)]
        self.spec = {**self.spec, INTERACTIVE: made}

    def end(self) -> Run | None:
        """Free the world and keep the run: whole ones, and interrupted ones that have passed a gate."""
        self.outcome = self.outcome or "interrupted"
        self.flight.close()
        with self._folder as folder:
            if self.outcome == "interrupted" and not any(e.kind == "pass" for e in self._recorder.events):
                return None
            run = self._recorder.run(self.spec)
            self._pictures = run.snapshots
            self._kept = folder.save(run)
        return run

    def competitor(self) -> Competitor:
        x, progress = self._trace.view()
        events = tuple(self._recorder.events)
        return Competitor(
            name=self.name,
            spec=self.spec,
            course=self.flight.course,
            legs=self.legs,
            x=x,
            progress=progress,
            events=events,
            laps=self.laps,
            outcome=self.outcome,
            live=True,
            pictures=self._pictures,
            sampled_trajectories=self.sampled_trajectories if self.outcome is None else None,
            folder=self._kept,
        )


def _laps(events: Sequence[Event], gates: int) -> tuple[float, ...]:
    completed = sum(e.kind == "pass" for e in events) // gates
    flown, extra = flown_laps(events, completed), lap_penalties(events, completed)
    return tuple(a + b for a, b in zip(flown, extra, strict=True))
