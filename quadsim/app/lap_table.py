"""Laps and splits as tables that fit the terminal: gates side by side, in as many parts as it takes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.markup import escape
from rich.table import Table

from quadsim.record.metrics import splits
from quadsim.record.run import Run

LEFT, PENALTY = 23, 9  # columns of the terminal for lap, time, top speed and the word "gate"; for penalties


def lap_tables(run: Run, gates: int, width: int) -> Iterator[Table | str]:
    """One table for every range of gates that fits side by side; the best of each column in green."""
    rows = splits(run)
    if not rows:
        yield "no gate passed"
        return
    cell = max(len(f"{t:.3f}") for row in rows for t in row) + 2
    left = LEFT + (PENALTY if any(run.penalties) else 0)
    parts = -(-gates // max(1, (width - left) // cell))
    fit = -(-gates // parts)
    for first in range(0, gates, fit):
        columns = {"lap": [str(i + 1) for i in range(len(rows))]}
        if first == 0:
            columns |= _whole_laps(run, len(rows))
        for gate in range(first, min(first + fit, gates)):
            name = f"gate {gate + 1}\n[s]" if gate == first else str(gate + 1)
            columns[name] = _times([row[gate] if gate < len(row) else None for row in rows])
        yield _side_by_side(columns)


def top_speeds(run: Run, laps: int) -> list[float]:
    """The fastest instant of each lap, the unfinished one too [m/s]."""
    x = run.telemetry
    speed = (x["vx"] ** 2 + x["vy"] ** 2 + x["vz"] ** 2) ** 0.5
    return [float(speed[x["lap"] == lap].max(initial=0.0)) for lap in range(1, laps + 1)]


def plain_table(**kwargs: Any) -> Table:
    """No lines, a quiet head."""
    return Table(box=None, header_style="dim", padding=(0, 2, 0, 0), **kwargs)


def _whole_laps(run: Run, laps: int) -> dict[str, list[str]]:
    """Time and top speed of each lap, and the penalties in it where there are any."""
    open_ = [None] * (laps - len(run.laps))
    columns = {"time\n[s]": _times([*run.laps, *open_])}
    if any(run.penalties):
        columns["penalty\n[s]"] = [f"{t:.0f}" if t else "" for t in (*run.penalties, *open_)]
    return columns | {"top\n[m/s]": [f"{v:.1f}" for v in top_speeds(run, laps)]}


def _times(times: list[float | None]) -> list[str]:
    """The shortest in green if there are several; a dash for what was not completed."""
    known = [t for t in times if t is not None]
    best = min(known) if len(known) > 1 else None
    return ["[dim]-[/]" if t is None else f"[green]{t:.3f}[/]" if t == best else f"{t:.3f}" for t in times]


def _side_by_side(columns: dict[str, list[str]]) -> Table:
    table = plain_table()
    for name in columns:
        table.add_column(escape(name), justify="right", no_wrap=True)
    for cells in zip(*columns.values(), strict=True):
        table.add_row(*cells)
    return table
