"""A flight while it is flown: its frames so far, the notices they give rise to, its run when it ends."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from quadsim.race.events import Frame, flown_laps, lap_penalties
from quadsim.record.archive import RunFolder
from quadsim.record.planner_snapshot import PlannerSnapshots
from quadsim.record.run import COLUMNS, INTERACTIVE, Recorder
from web.choices import Flight, Numbers
from web.competitor import CRASHES, Competitor, Legs

if TYPE_CHECKING:
    from controllers.sampled_trajectories import SampledTrajectories


class Trace:
    """COLUMNS and progress, one row a frame. Views of it stay valid while it grows."""

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
        """Telemetry by column, and progress [m]."""
        rows = self._table[: self._n]
        return {name: rows[:, i] for i, name in enumerate(COLUMNS)}, rows[:, -1]


class LiveCompetitor:
    """Flown frame by frame, stored in a run folder when it ends."""

    def __init__(self, flight: Flight, root: str, name: str):
        self.flight, self.name = flight, name
        self.outcome: str | None = None
        self._spec = dict(flight.spec)
        self._legs = Legs(flight.course, self._spec["laps"])
        self._folder = RunFolder.open(root, self._spec)
        self._trace, self._recorder = Trace(self._legs), Recorder()
        self._sampled_trajectories: SampledTrajectories | None = None
        self._snapshots: PlannerSnapshots | None = None
        self._stored: Path | None = None

    @property
    def t(self) -> float:
        """Of the last frame [s]; before the first, one period before the start."""
        return self._recorder.last.t if self._recorder.last else -self.flight.period

    @property
    def laps(self) -> tuple[float, ...]:
        """Completed, penalties included [s]."""
        events = self._recorder.events
        completed = sum(e.kind == "pass" for e in events) // self._legs.gates
        flown, penalties = flown_laps(events, completed), lap_penalties(events, completed)
        return tuple(a + b for a, b in zip(flown, penalties, strict=True))

    def advance(self) -> Frame:
        """Plan, fly one period. The last frame of a flight carries its outcome."""
        frame = next(self.flight.frames)
        self._recorder.add(frame)
        self._trace.append(frame)
        self.outcome = frame.outcome
        return frame

    def update_trajectories(self) -> None:
        """Take the sampled trajectories of the last plan, for display."""
        self._sampled_trajectories = self.flight.sampled_trajectories()

    def tune(self, numbers: Numbers, changes: list[dict]) -> None:
        """Use these numbers from the next plan on; the changes, {name, from, to}, are noted in the spec."""
        self.flight.tune(numbers)
        noted = [{"t": max(self.t, 0.0), **change} for change in changes]
        self._spec = {**self._spec, INTERACTIVE: [*self._spec.get(INTERACTIVE, []), *noted]}

    def end(self) -> None:
        """Free the plant and store the run, unless it was interrupted before its first gate."""
        self.outcome = self.outcome or "interrupted"
        self.flight.close()
        with self._folder as folder:
            if self.outcome != "interrupted" or any(e.kind == "pass" for e in self._recorder.events):
                run = self._recorder.run(self._spec)
                self._snapshots, self._stored = run.snapshots, folder.save(run)

    def competitor(self) -> Competitor:
        x, progress = self._trace.view()
        return Competitor(
            name=self.name,
            spec=self._spec,
            course=self.flight.course,
            legs=self._legs,
            x=x,
            progress=progress,
            events=tuple(self._recorder.events),
            laps=self.laps,
            outcome=self.outcome,
            live=True,
            snapshots=self._snapshots,
            sampled_trajectories=self._sampled_trajectories if self.outcome is None else None,
            folder=self._stored,
        )


@dataclass(frozen=True)
class Notice:
    """A message that the page shows for some seconds."""

    number: int  # counts up, so that a page shows each once
    kind: str  # error, crash, lap, wait
    title: str
    text: str


class Notices:
    def __init__(self) -> None:
        self._recent: deque[Notice] = deque(maxlen=20)
        self._number = 0

    @property
    def recent(self) -> tuple[Notice, ...]:
        return tuple(self._recent)

    def add(self, kind: str, title: str, text: str) -> None:
        self._number += 1
        self._recent.append(Notice(self._number, kind, title, text))

    def add_events(self, name: str, frame: Frame, laps: tuple[float, ...]) -> None:
        """Crashes, a best lap or the end of the race, where this frame has one."""
        what = {"hit": "hit gate {gate}", "ground": "hit the ground", "bounds": "left the bounds"}
        for e in frame.events:
            if e.kind in CRASHES:
                self.add("crash", f"{name}: {what[e.kind].format(gate=e.gate)}", f"at {e.t:.2f} s, {e.speed:.1f} m/s")
            if e.kind == "timeout":
                self.add("crash", f"{name}: out of time", f"after {e.t:.1f} s")
        passed = any(e.kind == "pass" for e in frame.events)
        if passed and len(laps) > 1 and laps[-1] == min(laps) and abs(sum(laps) - frame.t) < 0.02:
            self.add("lap", f"{name}: best lap", f"{laps[-1]:.3f} s")
        if frame.outcome == "finished":
            self.add("lap", f"{name}: finished", f"{len(laps)} laps in {sum(laps):.3f} s")
