"""Competitor: one flight as the page sees it, live or stored, and what each was made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from controllers.plan import PlannerSnapshot
from quadsim.course import Course, parse_course
from quadsim.race.events import Event
from quadsim.record.archive import load_run
from quadsim.record.planner_snapshot import PlannerSnapshots
from quadsim.record.run import INTERACTIVE, Run, RunError
from web.progress import Legs
from web.replay_schema import ReplaySchema

if TYPE_CHECKING:
    from controllers.sampled_trajectories import SampledTrajectories


@dataclass(frozen=True, eq=False)
class Competitor:
    """A snapshot. Arrays are views that only ever grow elsewhere, so they may be read from any thread."""

    name: str
    spec: dict
    course: Course
    legs: Legs
    x: dict[str, np.ndarray]  # quadsim.record.run.COLUMNS, so far
    progress: np.ndarray  # [m]  (frames,)
    events: tuple[Event, ...]
    laps: tuple[float, ...]  # [s]
    outcome: str | None  # None: flying
    live: bool
    pictures: PlannerSnapshots | None = None  # of the planner, once the flight has ended
    sampled_trajectories: SampledTrajectories | None = None  # and while it flies
    folder: Path | None = None

    @property
    def sampler(self) -> str:
        return self.spec["sampler"]

    @property
    def t(self) -> np.ndarray:
        return self.x["t"]

    @property
    def changes(self) -> list[dict]:
        return self.spec.get(INTERACTIVE, [])

    def at(self, t: float) -> int:
        """Index of the frame at t."""
        return int(np.clip(np.searchsorted(self.t, t + 1e-9) - 1, 0, len(self.t) - 1))

    def picture(self, i: int) -> tuple[float, PlannerSnapshot] | None:
        """The last one kept up to frame i, and when it was taken [s]."""
        kept = self.pictures.latest(i) if self.pictures else None
        return (float(self.t[kept[0]]), kept[1]) if kept else None

    def at_place(self, progress: float) -> int:
        """Index of the frame that is this far along [m]."""
        return int(np.clip(np.searchsorted(self.progress, progress), 0, len(self.t) - 1))


def stored_competitor(path: Path) -> Competitor:
    """A run from the disk. Raises RunError, FileError."""
    run = load_run(path)
    try:
        msgspec.convert(run.spec, ReplaySchema)
    except msgspec.ValidationError as error:
        raise RunError(f"{path}: its spec lacks what the page shows: {error}") from error
    return run_competitor(run, parse_course(run.spec["course_text"], run.spec["course"]), path)


def run_competitor(run: Run, course: Course, path: Path | None) -> Competitor:
    legs, x = Legs(course, run.spec["laps"]), run.telemetry
    p = np.stack([x["px"], x["py"], x["pz"]], axis=1)
    return Competitor(
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
        pictures=run.snapshots,
        folder=path,
    )


def named(competitors: Sequence[Competitor]) -> tuple[Competitor, ...]:
    """Names that differ: the sampler, with the seed or a number where that is not enough."""
    samplers = [competitor.sampler for competitor in competitors]
    seeds = [f"{competitor.sampler} s{competitor.spec['seed']}" for competitor in competitors]
    numbers = [f"{competitor.sampler} #{i}" for i, competitor in enumerate(competitors, 1)]
    names = next(names for names in (samplers, seeds, numbers) if len(set(names)) == len(competitors))
    return tuple(replace(competitor, name=name) for competitor, name in zip(competitors, names, strict=True))


def lap_starts(competitor: Competitor) -> list[float]:
    """[s] of every lap begun."""
    return list(accumulate(competitor.laps, initial=0.0))
