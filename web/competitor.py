"""Competitor: one flight as the page shows it, live or stored; Legs: how far along the course it
is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import numpy as np

from controllers.plan import PlannerSnapshot
from controllers.presets import PRESETS
from quadsim.course import Course, parse_course
from quadsim.palette import Style, dotted, style
from quadsim.race.events import Event
from quadsim.record.archive import load_run
from quadsim.record.limits import LIMITS, StoredSolution, limit_of
from quadsim.record.planner_snapshot import PlannerSnapshots
from quadsim.record.run import INTERACTIVE, Run, RunError
from web.flight_factory import numbers_of

if TYPE_CHECKING:
    from controllers.sampled_trajectories import SampledTrajectories
    from quadsim.sensing.measurements import Corners

POSITION, VELOCITY, QUATERNION = ("px", "py", "pz"), ("vx", "vy", "vz"), ("qw", "qx", "qy", "qz")
CRASHES = ("hit", "ground", "bounds")  # kinds of events
ALL = slice(None)


class Legs:
    """The straight legs from the start through the gates of every lap."""

    def __init__(self, course: Course, laps: int):
        # (legs + 1, 3)
        centres = np.array([course.start.position, *(g.position for g in course.gates * laps)])
        # after the finish: the last gate
        self._from, self._to = centres, np.vstack([centres[1:], centres[-1]])
        self.gates = len(course.gates)
        # [m]  (legs + 1,)
        self.ends = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(centres, axis=0), axis=1)))
        self.length = float(self.ends[-1])  # of the whole race [m]
        # progress at which each lap ends [m]  (laps,)
        self.lap_ends = self.ends[self.gates :: self.gates]

    def progress(self, p: np.ndarray, passed: np.ndarray) -> np.ndarray:
        """[m] at positions p (n, 3) after so many gates: the share d0 / (d0 + d1) of the leg, by
        the distances from its two ends. It grows right after a gate, also where the path makes a
        detour, and never decreases.  (n,)
        """
        k = np.minimum(np.asarray(passed, int), len(self.ends) - 1)
        d0, d1 = (np.linalg.norm(p - end[k], axis=1) for end in (self._from, self._to))
        legs = np.append(np.diff(self.ends), 0.0)[k]
        return np.maximum.accumulate(self.ends[k] + legs * d0 / np.maximum(d0 + d1, 1e-9))


@dataclass(frozen=True, eq=False)
class Competitor:
    """A flight at one moment. Rows that its arrays show are never written again: any thread may
    read them."""

    name: str
    spec: dict
    course: Course
    legs: Legs
    x: dict[str, np.ndarray]  # quadsim.record.run.COLUMNS, so far
    events: tuple[Event, ...]
    laps: tuple[float, ...]  # [s]
    outcome: str | None  # None: flying
    live: bool
    snapshots: PlannerSnapshots | None = None  # of the planner, once the flight has ended
    sampled_trajectories: SampledTrajectories | None = None  # while it flies
    folder: Path | None = None
    start_numbers: Mapping[str, float] = field(default_factory=dict)  # of web.flight_factory.RANGES
    again: bool = False  # another competitor before it has the same sampler
    limit: StoredSolution | None = None  # the best known of its race
    corners: Corners | None = None  # of gates, found in its camera's last picture, while it flies

    @cached_property
    def progress(self) -> np.ndarray:
        """Along the race [m].  (frames,)"""
        return self.legs.progress(self.rows(POSITION), self.x["passed"])

    @property
    def sampler(self) -> str:
        return self.spec["sampler"]

    @property
    def sensed(self) -> bool:
        """Whether it has an estimate beside the truth."""
        return bool(self.spec.get("sensing")) and "est_px" in self.x

    @property
    def style(self) -> Style:
        """Its sampler's; dotted where another competitor has that already."""
        return dotted(style(self.sampler)) if self.again else style(self.sampler)

    @property
    def t(self) -> np.ndarray:
        return self.x["t"]

    @property
    def state(self) -> tuple[int, str | None, int]:
        """Differs where anything of it that is shown differs."""
        return len(self.t), self.outcome, len(self.changes)

    def past(self, t: float) -> tuple[int, int, int, int, bool]:
        """Differs where its events, laps or changes until t differ, or whether its end is seen."""
        events = sum(e.t <= t + 1e-9 for e in self.events)
        changes = sum(c["t"] <= t + 1e-9 for c in self.changes)
        over = self.outcome is not None and (not len(self.t) or t >= self.t[-1] - 1e-9)
        return len(self.events), len(self.changes), events, changes, over

    @property
    def changes(self) -> list[dict]:
        """Of the planner's numbers in flight."""
        return self.spec.get(INTERACTIVE, [])

    def numbers(self, t: float) -> dict[str, float]:
        """The planner's numbers at t: those of the start with the changes until then."""
        return {**self.start_numbers, **{c["name"]: c["to"] for c in self.changes if c["t"] <= t}}

    @property
    def lap_starts(self) -> list[float]:
        """[s] of every lap begun, and the end of the last one completed."""
        return list(accumulate(self.laps, initial=0.0))

    def rows(self, names: Sequence[str], rows: int | slice | np.ndarray = ALL) -> np.ndarray:
        """These columns side by side.  (rows, names); (names,) for one row"""
        return np.stack([self.x[name][rows] for name in names], axis=-1)

    def speed(self, rows: int | slice | np.ndarray = ALL) -> np.ndarray:
        """[m/s]"""
        return np.linalg.norm(self.rows(VELOCITY, rows), axis=-1)

    def at(self, t: float) -> int:
        """Index of the frame at t."""
        return int(np.clip(np.searchsorted(self.t, t + 1e-9) - 1, 0, len(self.t) - 1))

    def until(self, t: float) -> Competitor:
        """As it was at t: later frames, events, laps and the outcome left out."""
        if not len(self.t) or t >= self.t[-1] - 1e-9:
            return self
        rows, ends = slice(self.at(t) + 1), self.lap_starts[1:]
        x = {name: column[rows] for name, column in self.x.items()}
        events = tuple(e for e in self.events if e.t <= t + 1e-9)
        laps = tuple(lap for lap, end in zip(self.laps, ends, strict=True) if end <= t + 1e-9)
        return replace(self, x=x, events=events, laps=laps, outcome=None)

    def at_place(self, progress: float) -> int:
        """Index of the first frame that is this far along [m]."""
        return int(np.clip(np.searchsorted(self.progress, progress), 0, len(self.t) - 1))

    def snapshot(self, i: int) -> tuple[float, PlannerSnapshot] | None:
        """The last planner snapshot up to frame i, and its time [s]."""
        found = self.snapshots.latest(i) if self.snapshots else None
        return (float(self.t[found[0]]), found[1]) if found else None


def named(entries: Sequence[Competitor]) -> tuple[Competitor, ...]:
    """With names that differ: the sampler, with the seed or a number where that is not enough."""
    samplers = [e.sampler for e in entries]
    seeds = [f"{e.sampler} s{e.spec['seed']}" for e in entries]
    numbers = [f"{e.sampler} #{i}" for i, e in enumerate(entries, 1)]
    names = next(names for names in (samplers, seeds, numbers) if len(set(names)) == len(entries))
    again = [e.sampler in samplers[:i] for i, e in enumerate(entries)]
    shown = zip(entries, names, again, strict=True)
    return tuple(
        e if (e.name, e.again) == (n, a) else replace(e, name=n, again=a) for e, n, a in shown
    )


class _MPPI(msgspec.Struct):
    samples: int
    temperature: float = 1.0
    target_ess: float | None = None
    ess: float | None = None  # the name of the same in older runs


class _Sampling(msgspec.Struct):
    sigma: list[float] | None = None
    gamma: list[float] | None = None


class _Planner(msgspec.Struct):
    mppi: _MPPI
    sampling: _Sampling | str | None = None


class _Change(msgspec.Struct):
    t: float
    name: str
    before: float = msgspec.field(name="from")
    after: float = msgspec.field(name="to")


class ReplaySchema(msgspec.Struct):
    """What a spec must hold to be shown. A run may have been made by hand, or by another
    version."""

    course: str
    sampler: str
    preset: str
    seed: int
    laps: Annotated[int, msgspec.Meta(ge=1)]
    vehicle: dict
    planner: _Planner
    interactive: list[_Change] = []


def stored_competitor(path: Path) -> Competitor:
    """A run from the disk. Raises RunError, FileError."""
    run = load_run(path)
    try:
        msgspec.convert(run.spec, ReplaySchema)
    except msgspec.ValidationError as error:
        raise RunError(f"{path}: its spec lacks what the page shows: {error}") from error
    return run_competitor(run, parse_course(run.spec["course_text"], run.spec["course"]), path)


def run_competitor(run: Run, course: Course, path: Path | None) -> Competitor:
    legs, laps = Legs(course, run.spec["laps"]), tuple(run.laps)
    shown = (
        run.spec["sampler"],
        run.spec,
        course,
        legs,
        run.telemetry,
        run.events,
        laps,
        run.outcome,
    )
    limit = limit_of(run.spec, *([path.parent / LIMITS] if path else []))
    planner = PRESETS.get(str(run.spec["preset"]), {}).get(run.spec["sampler"])
    numbers = numbers_of(run.spec["planner"], getattr(planner and planner.sampling, "sigma", ()))
    kept = {"snapshots": run.snapshots, "folder": path, "limit": limit}
    return Competitor(*shown, live=False, start_numbers=numbers, **kept)
