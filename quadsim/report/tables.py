"""The tables of a report: laps and splits, incidents, chatter, published times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil
from typing import NamedTuple

from rich.console import RenderableType
from rich.markup import escape
from rich.table import Table

from quadsim.console import plain_table
from quadsim.course import Course
from quadsim.racing.events import Event
from quadsim.record.run import RecordedRun
from quadsim.report.metrics import chatter, speed, splits

# Columns of the terminal for lap, time, top speed and the word "gate"; and for penalties
LEFT = 23
PENALTY = 9
INCIDENTS = ("hit", "miss", "wrong_way", "ground", "bounds", "stuck", "unseen_contact")


class Measure(NamedTuple):
    """A row of the table of chatter."""

    # In `metrics.chatter`
    key: str
    name: str
    unit: str
    factor: float = 1.0


CHATTER = (
    Measure("thrust_tv", "thrust, total variation per second", "m/s^2/s"),
    Measure("thrust_slew_max", "thrust, largest rate of change", "m/s^2/s"),
    Measure(
        "high_frequency_fraction",
        "thrust variance above motor cut-off {corner:.1f} Hz",
        "%",
        factor=100.0,
    ),
    Measure("motor_residual", "thrust minus its low-pass ({tau:g} s), RMS", "m/s^2"),
    Measure("body_rates_tv", "body rates, total variation per second", "rad/s^2"),
)


def lap_tables(run: RecordedRun, gates: int, width: int) -> Iterator[Table | str]:
    """Yield tables of laps and splits, each with as many gates as fit the width.

    The best time of each column is green.

    Args:
        run: run to report.
        gates: number of gates of the course.
        width: width of the terminal in columns.
    """
    rows = splits(run)
    if not rows:
        yield "no gate passed"
        return
    # Ranges of about equal length, as few as fit
    cell = max(len(f"{t:.3f}") for row in rows for t in row) + 2
    left = LEFT + PENALTY if any(run.penalties) else LEFT
    ranges = ceil(gates / max(1, (width - left) // cell))
    fit = ceil(gates / ranges)
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
    shown = ceil(passed / fit) * fit
    if shown < gates:
        yield f"gates {shown + 1} to {gates} were not passed"


def _whole_laps(run: RecordedRun, laps: int) -> dict[str, list[str]]:
    """Return columns with time and top speed of each lap, and with penalties if there are any."""
    v = speed(run)
    unfinished = [None] * (laps - len(run.laps))
    columns = {"time\n[s]": _times([*run.laps, *unfinished])}
    if any(run.penalties):
        columns["penalty\n[s]"] = [f"{t:.0f}" if t else "" for t in (*run.penalties, *unfinished)]
    top_speeds = [v[run.telemetry["lap"] == lap].max(initial=0.0) for lap in range(1, laps + 1)]
    columns["top\n[m/s]"] = [f"{top:.1f}" for top in top_speeds]
    return columns


def _times(times: Sequence[float | None]) -> list[str]:
    """Return times as text, the shortest one in green and a dash for a missing time."""
    known = [t for t in times if t is not None]
    best = min(known) if len(known) > 1 else None
    return [_time_text(t, best) for t in times]


def _time_text(t: float | None, best: float | None) -> str:
    if t is None:
        return "[dim]-[/]"
    if t == best:
        return f"[green]{t:.3f}[/]"
    return f"{t:.3f}"


def incident_table(run: RecordedRun) -> RenderableType:
    """Return a table with a row for each hit, miss and the like, or a line if there were none."""
    incidents = [event for event in run.events if event.kind in INCIDENTS]
    if not incidents:
        return "no hits, no misses"
    heads = (
        "t\n[s]",
        "lap",
        "gate",
        "incident",
        "left\n[m]",
        "up\n[m]",
        "speed\n[m/s]",
        "at x, y, z\n[m]",
    )
    table = plain_table(*heads, left=(3,))
    for event in incidents:
        offset = [f"{v:+.2f}" for v in event.offset] if event.gate else ["", ""]
        table.add_row(
            f"{event.t:.3f}",
            str(event.lap),
            str(event.gate or ""),
            f"[red]{_incident_name(event)}[/]",
            *offset,
            f"{event.speed:.1f}",
            ", ".join(f"{number:.1f}" for number in event.position),
        )
    return table


def _incident_name(event: Event) -> str:
    name = event.kind.replace("_", " ")
    if event.kind == "stuck":
        name = "no progress"
    return f"{name}, {event.place}" if event.obstacle else name


def chatter_table(run: RecordedRun) -> Table:
    """Return the table of chatter, for the commanded and the delivered thrust."""
    numbers = chatter(run)
    table = plain_table("chatter", "commanded", "delivered", "", left=(0, 3))
    for measure in CHATTER:
        name = measure.name.format(corner=numbers["motor_corner"], tau=numbers["motor_tau"])
        commanded = measure.factor * numbers["commanded"][measure.key]
        delivered = measure.factor * numbers["delivered"][measure.key]
        table.add_row(name, f"{commanded:.1f}", f"{delivered:.1f}", f"[dim]{measure.unit}[/]")
    return table


def published_table(run: RecordedRun, course: Course) -> RenderableType:
    """Return a table of the run's times and the published times, in order."""
    if not course.published:
        return "[dim]no times are published for this course[/]"
    times = [(published.time, published.who, "") for published in course.published]
    if run.laps:
        times.append((min(run.laps), "this run, best lap", "bold"))
    if len(run.laps) > 1:
        times.append((sum(run.laps), f"this run, {len(run.laps)} laps", "bold"))
    head = "published: other vehicles and simulators, sources in the course file"
    table = plain_table("time [s]", head, left=(1,))
    for time, who, style in sorted(times):
        table.add_row(f"{time:.3f}", escape(who), style=style)
    return table
