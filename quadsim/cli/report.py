"""The report of a run, as text or as one JSON object: printed after a flight and, from the disk, by
`race show`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import RenderableType
from rich.markup import escape
from rich.padding import Padding

from quadsim.cli.model_differences import differing, model_table
from quadsim.cli.report_tables import chatter_table, incident_table, lap_tables, published_table
from quadsim.console import emit, emit_json, width
from quadsim.course import parse_course
from quadsim.record.estimate_metrics import sensing_numbers
from quadsim.record.limits import LIMITS, Limit, limit_of
from quadsim.record.metrics import chatter, missed_deadlines, splits
from quadsim.record.run import INTERACTIVE, Run, flown_with, not_comparable, own_parts
from quadsim.record.turning_back import turned_back

COLOUR = {"finished": "green", "crashed": "red"}  # of an outcome; any other is yellow
SILENT = 1.0  # [s] without a pose or a corner after which the report says so


def present(run: Run, folder: Path | None, as_json: bool) -> None:
    """folder: where the run was stored, None if it could not be."""
    if as_json:
        emit_json(summary(run, folder))
    else:
        emit(*report(run, folder, width()))


def report(run: Run, folder: Path | None, columns: int) -> Iterator[RenderableType]:
    course = parse_course(run.spec["course_text"], run.spec["course"])
    yield from _head(run, known_limit(run, folder))
    parts = [*lap_tables(run, len(course.gates), columns - 2), incident_table(run)]
    if turns := _turned_back(run):
        parts.append(turns)
    parts += [chatter_table(run), _planning(run)]
    if seen := _sensing(run):
        parts.append(seen)
    if not run.spec.get("pilot"):
        parts.append(model_table(run.spec))
    if own := own_parts(run.spec):
        named = ", ".join(f"{role} {escape(name)}" for role, name in own.items())
        parts.append(f"[dim]own parts[/]  {named}: run.json alone cannot fly it again")
    parts.append(published_table(run, course))
    for part in parts:
        yield ""
        yield Padding(part, (0, 0, 0, 2), expand=False)
    yield ""
    yield f"stored in {escape(str(folder))}" if folder else "[red]not stored[/]"


def known_limit(run: Run, folder: Path | None) -> Limit | None:
    """The best known limit of the run's race, of those that come with the project and those kept
    beside the run."""
    return limit_of(run.spec, *([folder.parent / LIMITS] if folder else []))


def _turned_back(run: Run) -> str:
    """Where the vehicle overshot a gate and returned; empty where it never did."""
    places = [
        f"gate {turn['gate']} (lap {turn['lap']}, {turn['t']:.2f} s)" for turn in turned_back(run)
    ]
    return f"[yellow]turned back[/] to {', '.join(places)}" if places else ""


def _head(run: Run, limit: Limit | None) -> Iterator[str]:
    spec, colour = run.spec, COLOUR.get(run.outcome, "yellow")
    reached = f"{len(run.laps)} of {spec['laps']} laps, {run.duration:.3f} s"
    yield f"[bold]{escape(spec['course'])}[/]  [bold {colour}]{run.outcome}[/]  {reached}"
    randomized = f", randomized {spec['randomize']:g}" if spec.get("randomize") else ""
    displaced = (
        f", gates up to {spec['displace_gates']:g} m off the map"
        if spec.get("displace_gates")
        else ""
    )
    yield escape(flown_with(spec)) + randomized + displaced
    if limit and run.outcome == "finished":
        above = round(100.0 * limit.above(run.duration), 1) + 0.0  # no negative zero
        yield f"[bold]{above:.1f} %[/] above the best known limit of {limit.time:.3f} s"
    if remark := not_comparable(spec):
        yield f"[yellow]{remark}[/]"


def _planning(run: Run) -> str:
    ms, ess = run.wall["plan_ms"], run.telemetry["ess"]
    median = float(np.median(ess)) if len(ess) else 0.0
    wall = run.spec["clock"] == "wall"
    missed = f", {missed_deadlines(run)} of {len(ess)} deadlines missed" if wall else ""
    sampled = "" if run.spec.get("pilot") else f", median ESS {median:.0f}"
    return (
        f"[dim]{'planning' if sampled else 'pilot'}[/]  {ms['p50']:.1f} ms p50, {ms['p95']:.1f} ms p95"
        f"{sampled}{missed}\n[dim]simulation[/]  {run.wall['real_time_factor']:.2f} x real time"
    )


def _sensing(run: Run) -> str:
    """How far the estimate was off the truth; empty where the planner was given the truth."""
    n = sensing_numbers(run)
    if n is None:
        return ""
    at_gates = "" if n["at_gates"] is None else f", {100 * n['at_gates']:.1f} cm at gates"
    lines = [
        f"[dim]sensing[/]  {escape(n['sensing'])}: position {100 * n['position_rms']:.1f} cm RMS off{at_gates}, "
        f"{100 * n['position_max']:.1f} cm at most",
        f"consistency: NEES {n['nees']:.1f} of {n['nees_expected']} expected"
        + (
            ""
            if n["nis"] is None
            else f", NIS {n['nis']:.2f} of 1, {100 * n['refused']:.1f} % refused as outliers"
        ),
    ]
    if n["in_view"] is not None:
        lines.append(
            f"corners: {n['in_view']:.1f} in a picture that shows any, {100 * n['found']:.0f} % of them found"
        )
    if n["unaided"] >= SILENT:
        lines.append(f"[bold]no pose and no corner was used in the last {n['unaided']:.1f} s[/]")
    ms = n["estimate_ms"]
    return "\n".join([*lines, f"estimate: {ms['p50']:.2f} ms p50, {ms['p95']:.2f} ms p95"])


def summary(run: Run, folder: Path | None) -> dict:
    """Seconds, metres, m/s; `plan_ms` in milliseconds. limit: null where none is known.
    run_dir is null when the run could not be stored."""
    spec, finished, limit = run.spec, run.outcome == "finished", known_limit(run, folder)
    return {
        **{name: spec[name] for name in ("course", "sampler", "preset")},
        "vehicle": spec["vehicle"]["name"],
        "seed": spec["seed"],
        "outcome": run.outcome,
        "duration": run.duration,
        "laps": run.laps,
        "penalties": run.penalties,
        "splits": splits(run),
        "gates": run.gates,
        "limit": limit
        and {"time": limit.time, "above": limit.above(run.duration) if finished else None},
        "turned_back": turned_back(run),
        "events": [e.record() for e in run.events],
        "chatter": chatter(run),
        "model_differs": differing(spec),
        "sensing": sensing_numbers(run),
        "own_parts": own_parts(spec),
        "clock": spec["clock"],
        INTERACTIVE: spec.get(INTERACTIVE, []),
        "missed_deadlines": missed_deadlines(run),
        **run.wall,
        "digest": run.digest(),
        "run_dir": None if folder is None else str(folder),
    }
