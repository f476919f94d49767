"""Runs from the disk: as competitors, and in a list by title."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import cache
from pathlib import Path

import msgspec

from controllers.presets import PRESETS
from quadsim.course import Course, parse_course
from quadsim.heat.archive import heat_title, is_heat, list_heats, runs_of_heat
from quadsim.racing.along import Legs
from quadsim.record.archive import list_runs, load_reportable
from quadsim.record.limits import limit_of, limits_folder
from quadsim.record.run import RecordedRun, RunError, flown_by
from quadsim.record.schema import ReplayedPlanner, ReplayedSampling, ReplayedSpec
from quadsim.results.stored_runs import UNREADABLE, flown_at, read_row
from web.competitor import Competitor
from web.numbers import slider_values


def runs_at(path: Path) -> list[Path]:
    """Return the folders of the runs of a race of several, or the folder of a run itself.

    Raises:
        RunError: the race has no runs.
    """
    return runs_of_heat(path) if is_heat(path) else [path]


def stored_competitor(path: Path) -> Competitor:
    """Load a run from the disk.

    Raises:
        RunError: the run is damaged, or its spec lacks displayed parts.
        FileError: the course cannot be read.
    """
    run = load_reportable(path)
    try:
        msgspec.convert(run.spec, ReplayedSpec)
    except msgspec.ValidationError as error:
        raise RunError(f"{path}: its spec lacks what the page shows: {error}") from error
    course = parse_course(run.spec["course_text"], run.spec["course"])
    return run_competitor(run, course, path)


def run_competitor(run: RecordedRun, course: Course, path: Path | None) -> Competitor:
    """Return a run as a competitor. path: folder of the run, None if it is not stored."""
    spec = run.spec
    return Competitor(
        name=flown_by(spec),
        spec=spec,
        course=course,
        legs=Legs(course, spec["laps"]),
        x=run.telemetry,
        events=run.events,
        laps=tuple(run.laps),
        outcome=run.outcome,
        live=False,
        snapshots=run.snapshots,
        folder=path,
        start_numbers=stored_numbers(spec),
        limit=limit_of(spec, limits_folder(_root_of(path))) if path else limit_of(spec),
    )


def _root_of(path: Path) -> Path:
    """Return the folder of runs for a run that lies in it directly or in a race's folder."""
    return path.parent.parent if is_heat(path.parent) else path.parent


def stored_numbers(spec: dict) -> dict[str, float]:
    """Return the values of the sliders for a run's planner at its start."""
    planner = msgspec.convert(spec["planner"], ReplayedPlanner)
    sampling = planner.sampling
    if not isinstance(sampling, ReplayedSampling):
        sampling = ReplayedSampling()
    return slider_values(
        sigma=sampling.sigma,
        preset_sigma=_preset_sigma(spec["preset"], spec["sampler"]),
        gamma=sampling.gamma,
        temperature=planner.mppi.temperature,
        target_ess=planner.mppi.target_ess,
        samples=planner.mppi.samples,
    )


def _preset_sigma(preset: str, sampler: str) -> Sequence[float]:
    """Return the preset's standard deviations; none if the preset was a file."""
    planners = PRESETS.get(preset, {})
    return planners[sampler].sampling.sigma if sampler in planners else ()


def titled_runs(root: str, most: int) -> dict[str, Path]:
    """Return the latest stored runs by title, as "16:15 split_s_swift colored 16.378 s".

    A race of several vehicles is one entry, with the folder of the race.

    Args:
        root: the folder of runs.
        most: largest number of runs, the latest first.
    """
    found: dict[str, Path] = {}
    stored = sorted([*list_runs(root), *list_heats(root)])
    for path in stored[: -most - 1 : -1]:
        when = flown_at(path)
        today = when.date() == datetime.now().date()
        clock = when.strftime("%H:%M" if today else "%d %b %H:%M")
        title = f"{clock} {_result(path)}"
        if title in found:
            # The seconds distinguish two runs of one title within a minute.
            title = f"{clock}:{when.strftime('%S')} {_result(path)}"
        if title in found:
            title = path.name
        found[title] = path
    return found


@cache
def _result(path: Path) -> str:
    """Return course, sampler and time or outcome; the folder's name if they are not readable."""
    if is_heat(path):
        return heat_title(path)
    try:
        row = read_row(path)
    except UNREADABLE:
        return path.name
    if row.time is not None:
        ended = f"{row.time:.3f} s"
    else:
        ended = f"{row.outcome}, lap {len(row.laps) + 1}"
    return f"{row.course} {row.sampler} {ended}"
