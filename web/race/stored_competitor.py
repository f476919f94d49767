"""Runs from the disk as competitors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from quadsim.controllers.samplers import SAMPLERS
from quadsim.course import Course
from quadsim.heat.archive import is_heat, runs_of_heat
from quadsim.limit.limits import limit_of, limits_folder
from quadsim.racing.along import Legs
from quadsim.record.archive import read_run
from quadsim.record.run import RecordedRun, flown_by
from quadsim.record.schema import ReplayedPlanner
from quadsim.report.preset_changes import usual_planner
from quadsim.web.race.competitor import Competitor, read_spec
from quadsim.web.state.numbers import numbers_of
from quadsim.web.state.plain_text import plain


def runs_at(path: Path) -> list[Path]:
    """Return the folders of the runs of a race of several, or the folder of a run itself.

    Raises:
        RunError: the race has no runs.
    """
    return runs_of_heat(path) if is_heat(path) else [path]


def stored_competitor(path: Path) -> Competitor:
    """Load a run from the disk.

    Raises:
        RunError: the run is damaged.
        FileError: the course cannot be read.
    """
    run = read_run(path)
    course = run.course
    return run_competitor(run, course, path)


def run_competitor(run: RecordedRun, course: Course, path: Path | None) -> Competitor:
    """Return a run as a competitor. path: folder of the run, None if it is not stored."""
    record = run.spec
    spec = read_spec(record)
    return Competitor(
        name=plain(flown_by(record)),
        record=record,
        spec=spec,
        course=course,
        legs=Legs(course, spec.laps),
        x=run.telemetry,
        events=run.events,
        laps=tuple(run.laps),
        outcome=run.outcome,
        live=False,
        snapshots=run.snapshots,
        folder=path,
        start_numbers=stored_numbers(record),
        limit=limit_of(record, limits_folder(_root_of(path))) if path else limit_of(record),
    )


def _root_of(path: Path) -> Path:
    """Return the folder of runs for a run that lies in it directly or in a race's folder."""
    return path.parent.parent if is_heat(path.parent) else path.parent


def stored_numbers(record: dict[str, Any]) -> dict[str, float]:
    """Return the values of the sliders for a run's planner at its start.

    record: the spec of the run.
    """
    planner = msgspec.convert(record["planner"], ReplayedPlanner)
    # Of a preset from a file nothing is known.
    preset = usual_planner(record) if record["sampler"] in SAMPLERS else None
    return numbers_of(planner, preset)
