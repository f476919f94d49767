"""The report of a run as a command prints it, as text or as JSON."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rich.console import RenderableType
from rich.markup import escape

from quadsim.console import complain, emit, emit_json, width
from quadsim.limit.limits import StoredSolution, limit_of, limits_folder
from quadsim.record.run import INTERACTIVE, RecordedRun, flown_by, own_parts
from quadsim.report.estimate_metrics import sensing_numbers
from quadsim.report.metrics import chatter, missed_deadlines, splits
from quadsim.report.model_differences import differing
from quadsim.report.report import report as run_report
from quadsim.report.turning_back import turned_back


def present(
    run: RecordedRun, folder: Path | None, as_json: bool, runs_dir: str | Path | None = None
) -> None:
    """Print the report of a run.

    Args:
        run: run to report.
        folder: folder of the stored run, None if it could not be stored.
        as_json: whether to print one JSON object instead of text.
        runs_dir: see `known_limit`.
    """
    if as_json:
        emit_json(summary(run, folder, runs_dir))
    else:
        emit(*report(run, folder, width(), runs_dir))


def known_limit(
    run: RecordedRun, folder: Path | None, runs_dir: str | Path | None = None
) -> StoredSolution | None:
    """Return the best known limit of a run's race.

    The search covers the project, the folder beside the run and the folder of runs.

    Args:
        run: run of the race.
        folder: folder of the stored run.
        runs_dir: folder of runs given to the command.
    """
    places = [folder.parent] if folder else []
    if runs_dir is not None:
        places.append(Path(runs_dir))
    folders = dict.fromkeys(limits_folder(place) for place in places)
    return limit_of(run.spec, *folders, remark=_remark)


def _remark(problem: str) -> None:
    """Write a remark that an unreadable solution is ignored."""
    complain(f"{problem}: it counts as none")


def report(
    run: RecordedRun, folder: Path | None, columns: int, runs_dir: str | Path | None = None
) -> Iterator[RenderableType]:
    """Yield the parts of the report of a run, and the path of its folder.

    Args:
        run: run to report.
        folder: folder of the stored run, None if it could not be stored.
        columns: width of the terminal in columns.
        runs_dir: see `known_limit`.
    """
    yield from run_report(run, known_limit(run, folder, runs_dir), columns)
    yield ""
    yield f"stored in {escape(str(folder))}" if folder else "[red]not stored[/]"


def summary(run: RecordedRun, folder: Path | None, runs_dir: str | Path | None = None) -> dict:
    """Return the report as JSON, in seconds, metres and m/s; `plan_ms` in milliseconds.

    limit is null if none is known; run_dir is null if the run could not be stored.

    Args:
        run: run to report.
        folder: folder of the stored run, None if it could not be stored.
        runs_dir: see `known_limit`.
    """
    spec = run.spec
    return {
        "course": run.course_name,
        "sampler": flown_by(spec),
        "preset": spec["preset"],
        "vehicle": spec["vehicle"]["name"],
        "seed": spec["seed"],
        "outcome": run.outcome,
        "fault": run.fault or None,
        "duration": run.duration,
        "laps": run.laps,
        "penalties": run.penalties,
        "splits": splits(run),
        "gates": run.gates,
        "limit": _limit_summary(run, known_limit(run, folder, runs_dir)),
        "turned_back": turned_back(run),
        "events": [event.record() for event in run.events],
        "chatter": chatter(run),
        "model_differs": differing(spec),
        "sensing": sensing_numbers(run),
        "faults": spec.get("drawn_faults", []),
        "own_parts": own_parts(spec),
        "clock": spec["clock"],
        INTERACTIVE: spec.get(INTERACTIVE, []),
        "missed_deadlines": missed_deadlines(run),
        **run.wall,
        "digest": run.digest(),
        "run_dir": None if folder is None else str(folder),
    }


def _limit_summary(run: RecordedRun, limit: StoredSolution | None) -> dict | None:
    """Return a limit as JSON; above: null if the race was not finished."""
    if limit is None:
        return None
    above = limit.above(run.duration) if run.outcome == "finished" else None
    return {"time": limit.time, "above": above}
