"""The tables in the report of a race: laps and splits, incidents, chatter, published times."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import RenderableType
from rich.markup import escape
from rich.table import Table

from quadsim.console import plain_table
from quadsim.course import Course
from quadsim.race.events import NO_PROGRESS
from quadsim.record.metrics import chatter, splits
from quadsim.record.run import Run

# columns of the terminal for lap, time, top speed and the word "gate"; for penalties
LEFT, PENALTY = 23, 9
INCIDENTS = ("hit", "miss", "wrong_way", "ground", "bounds", "stuck", "unseen_contact")
CHATTER = (  # key, what it is, unit, factor
    ("thrust_tv", "thrust, total variation per second", "m/s^2/s", 1.0),
    ("thrust_slew_max", "thrust, largest rate of change", "m/s^2/s", 1.0),
    ("high_frequency_fraction", "thrust variance above motor cut-off {corner:.1f} Hz", "%", 100.0),
    ("motor_residual", "thrust minus its low-pass ({tau:g} s), RMS", "m/s^2", 1.0),
    ("body_rates_tv", "body rates, total variation per second", "rad/s^2", 1.0),
)


def lap_tables(run: Run, gates: int, width: int) -> Iterator[Table | str]:
    """One table for every range of gates that fits side by side; the best of each column in
    green."""
    rows = splits(run)
    if not rows:
        yield "no gate passed"
        return
    cell = max(len(f"{t:.3f}") for row in rows for t in row) + 2
    left = LEFT + (PENALTY if any(run.penalties) else 0)
    parts = -(-gates // max(1, (width - left) // cell))
    fit = -(-gates // parts)
    passed = max(map(len, rows))
    for first in range(0, passed, fit):
        columns = {"lap": [str(i + 1) for i in range(len(rows))]}
        if first == 0:
            columns |= _whole_laps(run, len(rows))
        for gate in range(first, min(first + fit, gates)):
            name = f"gate {gate + 1}\n[s]" if gate == first else str(gate + 1)
            columns[name] = _times([row[gate] if gate < len(row) else None for row in rows])
        table = plain_table(*columns, no_wrap=True)
        for cells in zip(*columns.values(), strict=True):
            table.add_row(*cells)
        yield table
    if (shown := -(-passed // fit) * fit) < gates:
        yield f"gates {shown + 1} to {gates} were not passed"


def _whole_laps(run: Run, laps: int) -> dict[str, list[str]]:
    """Time and top speed of each lap, and the penalties in it where there are any."""
    x, unfinished = run.telemetry, [None] * (laps - len(run.laps))
    speed = (x["vx"] ** 2 + x["vy"] ** 2 + x["vz"] ** 2) ** 0.5
    columns = {"time\n[s]": _times([*run.laps, *unfinished])}
    if any(run.penalties):
        columns["penalty\n[s]"] = [f"{t:.0f}" if t else "" for t in (*run.penalties, *unfinished)]
    top_speeds = [speed[x["lap"] == lap].max(initial=0.0) for lap in range(1, laps + 1)]
    return columns | {"top\n[m/s]": [f"{v:.1f}" for v in top_speeds]}


def _times(times: list[float | None]) -> list[str]:
    """The shortest in green if there are several; a dash for what was not completed."""
    known = [t for t in times if t is not None]
    best = min(known) if len(known) > 1 else None
    return [
        "[dim]-[/]" if t is None else f"[green]{t:.3f}[/]" if t == best else f"{t:.3f}"
        for t in times
    ]


def incident_table(run: Run) -> RenderableType:
    found = [e for e in run.events if e.kind in INCIDENTS]
    if not found:
        return "no hits, no misses"
    table = plain_table(
        "t [s]", "lap", "gate", "incident", "left [m]", "up [m]", "speed [m/s]", left=(3,)
    )
    for e in found:
        offset = [f"{v:+.2f}" for v in e.offset] if e.gate else ["", ""]
        kind = (
            f"no progress for {NO_PROGRESS:g} s" if e.kind == "stuck" else e.kind.replace("_", " ")
        )
        kind += f", {e.place}" if e.obstacle else ""
        table.add_row(
            f"{e.t:.3f}",
            str(e.lap),
            str(e.gate or ""),
            f"[red]{kind}[/]",
            *offset,
            f"{e.speed:.1f}",
        )
    return table


def chatter_table(run: Run) -> Table:
    numbers = chatter(run)
    table = plain_table("chatter", "commanded", "delivered", "", left=(0, 3))
    for key, name, unit, factor in CHATTER:
        values = (f"{factor * numbers[of][key]:.1f}" for of in ("commanded", "delivered"))
        table.add_row(
            name.format(corner=numbers["motor_corner"], tau=numbers["motor_tau"]),
            *values,
            f"[dim]{unit}[/]",
        )
    return table


def published_table(run: Run, course: Course) -> RenderableType:
    """The run's times among the published ones, in order."""
    times = [(p.time, p.who, "") for p in course.published]
    if not times:
        return "[dim]no times are published for this course[/]"
    if run.laps:
        times.append((min(run.laps), "this run, best lap", "bold"))
    if len(run.laps) > 1:
        times.append((sum(run.laps), f"this run, {len(run.laps)} laps", "bold"))
    table = plain_table(
        "time [s]",
        "published: other vehicles and simulators, sources in the course file",
        left=(1,),
    )
    for time, who, style in sorted(times):
        table.add_row(f"{time:.3f}", escape(who), style=style)
    return table
