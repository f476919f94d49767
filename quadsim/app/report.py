"""The report of a run, as text or as one JSON object: printed after a flight and, from the disk, by `race show`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.console import RenderableType
from rich.markup import escape
from rich.padding import Padding

from quadsim.app import report_tables as tables
from quadsim.app.console import emit, emit_json, width
from quadsim.course import parse_course
from quadsim.record.metrics import chatter, missed_deadlines, splits
from quadsim.record.run import INTERACTIVE, Run, not_comparable

COLOUR = {"finished": "green", "crashed": "red", "timeout": "yellow", "interrupted": "yellow"}


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
        *tables.lap_tables(run, len(course.gates), columns - 2),
        tables.incident_table(run),
        tables.chatter_table(run),
        _planning(run),
        tables.model_table(run.spec),
        tables.published_table(run, course),
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
    randomized = f", randomized {spec['randomize']:g}" if spec.get("randomize") else ""
    yield f"{sampler} sampling, preset {preset}, vehicle {vehicle}, seed {spec['seed']}{randomized}"
    if remark := not_comparable(spec):
        yield f"[yellow]{remark}[/]"


def _planning(run: Run) -> str:
    ms, ess = run.wall["plan_ms"], run.telemetry["ess"]
    median = float(np.median(ess)) if len(ess) else 0.0
    wall = run.spec["clock"] == "wall"
    missed = f", {missed_deadlines(run)} of {len(ess)} deadlines missed" if wall else ""
    return (
        f"[dim]planning[/]  {ms['p50']:.1f} ms p50, {ms['p95']:.1f} ms p95, "
        f"{run.wall['real_time_factor']:.2f} x real time, median ESS {median:.0f}{missed}"
    )


def summary(run: Run, folder: Path | None) -> dict:
    """Seconds, metres, m/s; `plan_ms` in milliseconds. run_dir is null when the run could not be stored."""
    spec = run.spec
    return {
        **{name: spec[name] for name in ("course", "sampler", "preset")},
        "vehicle": spec["vehicle"]["name"],
        "seed": spec["seed"],
        "outcome": run.outcome,
        "laps": run.laps,
        "penalties": run.penalties,
        "splits": splits(run),
        "gates": run.gates,
        "events": [asdict(e) for e in run.events],
        "chatter": chatter(run),
        "model_differs": tables.model_differences(spec),
        "clock": spec["clock"],
        INTERACTIVE: spec.get(INTERACTIVE, []),
        "missed_deadlines": missed_deadlines(run),
        **run.wall,
        "digest": run.digest(),
        "run_dir": None if folder is None else str(folder),
    }
