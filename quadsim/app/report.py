"""The report of a run: printed after a flight and, from the disk, by `race show`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import RenderableType
from rich.markup import escape
from rich.padding import Padding
from rich.table import Table

from quadsim.app.console import emit, emit_json, width
from quadsim.app.lap_table import lap_tables, plain_table
from quadsim.app.model_differences import model_differences
from quadsim.app.summary import summary
from quadsim.course import Course, parse_course
from quadsim.record.metrics import chatter, missed_deadlines
from quadsim.record.run import Run, not_comparable

COLOUR = {"finished": "green", "crashed": "red", "timeout": "yellow", "interrupted": "yellow"}
INCIDENTS = ("hit", "miss", "wrong_way", "ground", "bounds", "unseen_contact")
CHATTER = (  # key, what it is, unit, factor
    ("thrust_tv", "total variation", "m/s^2/s", 1.0),
    ("thrust_slew_max", "largest slew", "m/s^2/s", 1.0),
    ("high_frequency_fraction", "power above {corner:.1f} Hz, the motors' corner", "%", 100.0),
    ("motor_residual", "beyond a motor of {tau:g} s, RMS", "m/s^2", 1.0),
)


def present(run: Run, folder: Path | None, as_json: bool) -> None:
    """folder: where the run was stored, None if it could not be."""
    if as_json:
        emit_json(summary(run, folder))
    else:
        emit(*report(run, folder, width()))


def report(run: Run, folder: Path | None, columns: int) -> Iterator[RenderableType]:
    course = parse_course(run.spec["course_text"], run.spec["course"])
    yield from _head(run)
    for part in (
        *lap_tables(run, len(course.gates), columns - 2),
        _incidents(run),
        _chatter(run),
        _planning(run),
        model_differences(run.spec),
        _published(run, course),
    ):
        yield ""
        yield Padding(part, (0, 0, 0, 2), expand=False)
    yield ""
    yield f"stored in {escape(str(folder))}" if folder else "[red]not stored[/]"


def _head(run: Run) -> Iterator[str]:
    spec, laps = run.spec, f"{len(run.laps)} of {run.spec['laps']} laps"
    end = run.events[-1].t if run.outcome != "interrupted" else float(run.telemetry["t"][-1])
    sampler, preset, vehicle = (escape(name) for name in (spec["sampler"], spec["preset"], spec["vehicle"]["name"]))
    yield f"[bold]{spec['course']}[/]  [bold {COLOUR[run.outcome]}]{run.outcome}[/]  {laps}, {end:.3f} s"
    day = f", randomized {spec['randomize']:g}" if spec.get("randomize") else ""
    yield f"{sampler} sampling, preset {preset}, vehicle {vehicle}, seed {spec['seed']}{day}"
    if remark := not_comparable(spec):
        yield f"[yellow]{remark}[/]"


def _incidents(run: Run) -> RenderableType:
    found = [e for e in run.events if e.kind in INCIDENTS]
    if not found:
        return "no hits, no misses"
    table = plain_table()
    for name in ("t [s]", "lap", "gate", "incident", "left [m]", "up [m]", "speed [m/s]"):
        table.add_column(escape(name), justify="left" if name == "incident" else "right")
    for e in found:
        offset = [f"{v:+.2f}" for v in e.offset] if e.gate else ["", ""]
        kind = e.kind.replace("_", " ")
        table.add_row(f"{e.t:.3f}", str(e.lap), str(e.gate or ""), f"[red]{kind}[/]", *offset, f"{e.speed:.1f}")
    return table


def _chatter(run: Run) -> Table:
    numbers = chatter(run)
    table = plain_table()
    table.add_column("thrust chatter")
    table.add_column("commanded", justify="right")
    table.add_column("delivered", justify="right")
    table.add_column("")
    for key, name, unit, factor in CHATTER:
        values = (f"{factor * numbers[of][key]:.1f}" for of in ("commanded", "delivered"))
        table.add_row(name.format(corner=numbers["motor_corner"], tau=numbers["motor_tau"]), *values, f"[dim]{unit}[/]")
    return table


def _planning(run: Run) -> str:
    ms, ess = run.wall["plan_ms"], run.telemetry["ess"]
    median = float(np.median(ess)) if len(ess) else 0.0
    wall = run.spec["clock"] == "wall"
    missed = f", {missed_deadlines(run)} of {len(ess)} deadlines missed" if wall else ""
    return (
        f"[dim]planning[/]  {ms['p50']:.1f} ms p50, {ms['p95']:.1f} ms p95, "
        f"{run.wall['real_time_factor']:.2f} x real time, median ESS {median:.0f}{missed}"
    )


def _published(run: Run, course: Course) -> RenderableType:
    """Ours between theirs, by time."""
    times = [(p.time, p.who, "") for p in course.published]
    if not times:
        return "[dim]nobody's times are published for this course[/]"
    if run.laps:
        times.append((min(run.laps), "this run, best lap", "bold"))
    if len(run.laps) > 1:
        times.append((sum(run.laps), f"this run, {len(run.laps)} laps", "bold"))
    table = plain_table()
    table.add_column(escape("time [s]"), justify="right")
    table.add_column("published, each with its own dynamics")
    for time, who, style in sorted(times):
        table.add_row(f"{time:.3f}", escape(who), style=style)
    return table
