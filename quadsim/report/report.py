"""The report of a run as text, for `race fly`, `race show` and `Run.report`."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap

import numpy as np
from rich.console import RenderableType
from rich.markup import escape
from rich.padding import Padding

from quadsim.limit.limits import StoredSolution
from quadsim.physics.randomization_file import OUTDOOR
from quadsim.record.run import RecordedRun, has_planner, why_not_repeatable
from quadsim.report.estimate_metrics import (
    drawn_imu_errors,
    drawn_imu_text,
    lost_estimate,
    sensing_numbers,
)
from quadsim.report.given_state import given_state
from quadsim.report.metrics import missed_deadlines
from quadsim.report.model_differences import model_table
from quadsim.report.run_text import crash_place, flown_with, learned_text, not_comparable
from quadsim.report.tables import (
    chatter_table,
    incident_table,
    lap_tables,
    published_table,
)
from quadsim.report.turning_back import turned_back

# Colour of an outcome; any other is yellow
COLOUR = {"finished": "green", "crashed": "red", "error": "red"}
# Columns of a line that holds all that a flight was flown with
WIDTH = 80
# Time without a pose or a corner after which the report says so [s]
SILENT = 1.0
# Columns by which the parts below the head are indented
INDENT = 2


def report(
    run: RecordedRun, limit: StoredSolution | None, columns: int
) -> Iterator[RenderableType]:
    """Yield the parts of the report of a run.

    Args:
        run: run to report.
        limit: the best known limit of the run's race.
        columns: width of the terminal in columns.
    """
    yield from _head(run, limit)
    for part in _parts(run, columns - INDENT):
        yield ""
        yield Padding(part, (0, 0, 0, INDENT), expand=False)


def _head(run: RecordedRun, limit: StoredSolution | None) -> Iterator[str]:
    spec = run.spec
    colour = COLOUR.get(run.outcome, "yellow")
    laps = f"{len(run.laps)} of {spec['laps']} laps"
    course = escape(run.course_name)
    place = crash_place(run).removeprefix("; ")
    yield f"[bold]{course}[/]  [bold {colour}]{run.outcome}[/]  {laps}, {run.duration:.3f} s"
    if place:
        yield escape(place)
    lost = lost_estimate(run)
    if lost:
        yield lost
    flown = [escape(flown_with(spec))]
    if spec.get("randomize"):
        drawn = spec["randomization"]["name"]
        by = "" if drawn == OUTDOOR.name else f" by {escape(drawn)}"
        flown.append(f"randomized {spec['randomize']:g}{by}")
    if spec["map_scale"] != 1.0:
        flown.append(f"a map of {spec['map_scale']:g} of the course's size")
    if spec.get("displace_gates"):
        flown.append(f"gates up to {spec['displace_gates']:g} m off the map")
    if spec.get("known_from"):
        flown.append(f"gates known within {spec['known_from']:g} m")
    yield from wrap(", ".join(flown), WIDTH, break_on_hyphens=False)
    state = given_state(spec)
    if state:
        yield state
    if learned := learned_text(run):
        yield f"learned in flight: {learned}"
    if limit and run.outcome == "finished":
        # Adding 0.0 makes a negative zero a plain one
        above = round(100.0 * limit.above(run.duration), 1) + 0.0
        yield f"[bold]{above:.1f} %[/] above the best known limit of {limit.time:.3f} s"
    remark = not_comparable(spec)
    if remark:
        yield f"[yellow]{remark}[/]"


def _parts(run: RecordedRun, columns: int) -> Iterator[RenderableType]:
    """Yield the tables below the first lines, fitted to the terminal's width in columns."""
    course = run.course
    yield from lap_tables(run, len(course.gates), columns)
    yield incident_table(run)
    turns = turned_back(run)
    if turns:
        places = [f"gate {turn['gate']} (lap {turn['lap']}, {turn['t']:.2f} s)" for turn in turns]
        yield f"[yellow]turned back[/] to {', '.join(places)}"
    yield chatter_table(run)
    yield _planning(run)
    sensing = _sensing(run)
    if sensing:
        yield sensing
    if has_planner(run.spec):
        yield model_table(run.spec)
    reason = why_not_repeatable(run)
    if reason:
        yield f"[dim]repeatable[/]  not from run.json alone: {escape(reason)}"
    yield published_table(run, course)


def _planning(run: RecordedRun) -> str:
    """Return the planning times and the speed of the simulation, as text."""
    plan_ms = run.wall["plan_ms"]
    ess = run.telemetry["ess"]
    name = run.spec["sampler"]  # pilot or hand
    parts = [f"{plan_ms['p50']:.1f} ms p50", f"{plan_ms['p95']:.1f} ms p95"]
    if has_planner(run.spec):
        name = "planning"
        median = float(np.median(ess)) if len(ess) else 0.0
        parts.append(f"median ESS {median:.0f}")
    if run.spec["clock"] == "wall":
        parts.append(f"{missed_deadlines(run)} of {len(ess)} deadlines missed")
    factor = f"{run.wall['real_time_factor']:.2f} x real time"
    return f"[dim]{name}[/]  {', '.join(parts)}\n[dim]simulation[/]  {factor}"


def _sensing(run: RecordedRun) -> str:
    """Return the estimate's errors as text, "" if the planner was given the true state."""
    n = sensing_numbers(run)
    if n is None:
        return ""
    position = [f"position {100 * n['position_rms']:.1f} cm RMS off"]
    if n["at_gates"] is not None:
        position.append(f"{100 * n['at_gates']:.1f} cm at gates")
    position.append(f"{100 * n['position_max']:.1f} cm at most")
    consistency = [f"NEES {n['nees']:.1f} of {n['nees_expected']} expected"]
    if n["nis"] is not None:
        consistency.append(f"NIS {n['nis']:.2f} of 1")
        consistency.append(f"{100 * n['refused']:.1f} % refused as outliers")
    lines = [
        f"[dim]sensing[/]  {escape(n['sensing'])}: {', '.join(position)}",
        f"consistency: {', '.join(consistency)}",
    ]
    if n["in_view"] is not None:
        share = f"{100 * n['found']:.0f} % of them found"
        lines.append(f"corners: {n['in_view']:.1f} in a picture that shows any, {share}")
    if n["unaided"] >= SILENT:
        lines.append(f"[bold]no pose and no corner was used in the last {n['unaided']:.1f} s[/]")
    drawn = drawn_imu_text(drawn_imu_errors(run.spec))
    if drawn:
        lines.append(drawn)
    ms = n["estimate_ms"]
    lines.append(f"estimate: {ms['p50']:.2f} ms p50, {ms['p95']:.2f} ms p95")
    return "\n".join(lines)
