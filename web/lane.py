"""Lane: one flight as the page sees it, live or stored, and what each was made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from quadsim.archive import RunFolder, load_run
from quadsim.course import Course, parse_course
from quadsim.run import COLUMNS, Event, Frame, Run, flown_laps, lap_penalties
from web.choices import Flight, Numbers
from web.progress import Legs

if TYPE_CHECKING:
    from controllers.fan import Fan

KEEP = "interactive"  # key of a spec: the changes made in flight, which make a run not comparable


@dataclass(frozen=True, eq=False)
class Lane:
    """A snapshot. Arrays are views that only ever grow elsewhere, so they may be read from any thread."""

    name: str
    spec: dict
    course: Course
    legs: Legs
    x: dict[str, np.ndarray]  # quadsim.run.COLUMNS, so far
    progress: np.ndarray  # [m]  (frames,)
    events: tuple[Event, ...]
    laps: tuple[float, ...]  # [s]
    outcome: str | None  # None: flying
    live: bool
    best: np.ndarray | None = None  # (frames, 8, points, 3) of a stored run
    fan: Fan | None = None  # of a live one
    folder: Path | None = None

    @property
    def sampler(self) -> str:
        return self.spec["sampler"]

    @property
    def t(self) -> np.ndarray:
        return self.x["t"]

    @property
    def changes(self) -> list[dict]:
        return self.spec.get(KEEP, [])

    def at(self, t: float) -> int:
        """Index of the frame at t."""
        return int(np.clip(np.searchsorted(self.t, t + 1e-9) - 1, 0, len(self.t) - 1))

    def at_place(self, progress: float) -> int:
        """Index of the frame that is this far along [m]."""
        return int(np.clip(np.searchsorted(self.progress, progress), 0, len(self.t) - 1))


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


class LiveLane:
    """A flight in the worker's hands: advanced frame by frame, kept in a run folder when it ends."""

    def __init__(self, flight: Flight, root: str, name: str):
        self.flight, self.name = flight, name
        self.spec = dict(flight.spec)
        self.legs = Legs(flight.course, self.spec["laps"])
        self._folder = RunFolder.open(root, self.spec)
        self._trace, self._frames, self._events = Trace(self.legs), [], []
        self.outcome: str | None = None
        self.fan: Fan | None = None
        self._kept: Path | None = None

    @property
    def t(self) -> float:
        """Of the last frame [s]; before the first, one period before the start."""
        return self._frames[-1].t if self._frames else -self.flight.period

    def advance(self) -> Frame:
        """Plan, fly one period. The last frame of a flight carries its outcome."""
        frame = next(self.flight.frames)
        self._frames.append(frame)
        self._events += frame.events
        self._trace.append(frame)
        self.outcome = frame.outcome
        return frame

    @property
    def laps(self) -> tuple[float, ...]:
        return _laps(self._events, self.legs.gates)

    def look(self) -> None:
        self.fan = self.flight.fan()

    def tune(self, numbers: Numbers, changes: list[dict]) -> None:
        self.flight.tune(numbers)
        now = {"t": max(self.t, 0.0)}
        self.spec = {**self.spec, KEEP: [*self.spec.get(KEEP, []), *(now | change for change in changes)]}

    def end(self) -> Run | None:
        """Free the world and keep the run: whole ones, and interrupted ones that have passed a gate."""
        self.outcome = self.outcome or "interrupted"
        self.flight.close()
        with self._folder as folder:
            if self.outcome == "interrupted" and not any(e.kind == "pass" for e in self._events):
                return None
            run = Run.from_frames(self.spec, self._frames)
            self._kept = folder.save(run)
        return run

    def lane(self) -> Lane:
        x, progress = self._trace.view()
        events = tuple(self._events)
        return Lane(
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
            fan=self.fan,
            folder=self._kept,
        )


def stored_lane(path: Path) -> Lane:
    """A run from the disk. Raises RunError, FileError."""
    run = load_run(path)
    return run_lane(run, parse_course(run.spec["course_text"], run.spec["course"]), path)


def run_lane(run: Run, course: Course, path: Path | None) -> Lane:
    legs, x = Legs(course, run.spec["laps"]), run.telemetry
    p = np.stack([x["px"], x["py"], x["pz"]], axis=1)
    return Lane(
        name=run.spec["sampler"],
        spec=run.spec,
        course=course,
        legs=legs,
        x=x,
        progress=legs.progress(p, x["passed"]) if len(p) else np.zeros(0),
        events=run.events,
        laps=tuple(run.laps),
        outcome=run.outcome,
        live=False,
        best=run.best,
        folder=path,
    )


def named(lanes: Sequence[Lane]) -> tuple[Lane, ...]:
    """Names that differ: the sampler, with the seed or a number where that is not enough."""
    samplers = [lane.sampler for lane in lanes]
    seeds = [f"{lane.sampler} s{lane.spec['seed']}" for lane in lanes]
    numbers = [f"{lane.sampler} #{i}" for i, lane in enumerate(lanes, 1)]
    names = next(names for names in (samplers, seeds, numbers) if len(set(names)) == len(lanes))
    return tuple(replace(lane, name=name) for lane, name in zip(lanes, names, strict=True))


def lap_starts(lane: Lane) -> list[float]:
    """[s] of every lap begun."""
    return list(accumulate(lane.laps, initial=0.0))


def _laps(events: Sequence[Event], gates: int) -> tuple[float, ...]:
    completed = sum(e.kind == "pass" for e in events) // gates
    flown, extra = flown_laps(events, completed), lap_penalties(events, completed)
    return tuple(a + b for a, b in zip(flown, extra, strict=True))
