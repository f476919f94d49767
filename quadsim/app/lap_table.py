"""Laps and splits as tables that fit the terminal: gates side by side, in as many parts as it takes."""

from __future__ import annotations

from collections.abc import Iterator

from rich.table import Table

from quadsim.metrics import splits
from quadsim.run import Run

LEFT, SPLIT = 20, 7  # columns of the terminal for lap, time and top speed, and for one gate


def lap_tables(run: Run, gates: int, width: int) -> Iterator[Table | str]:
    """One table for every run of gates that fits side by side. Times [s], speeds [m/s]; the best of each in green."""
    rows = splits(run)
    if not rows:
        yield "no gate passed"
        return
    fit = max(1, (width - LEFT) // SPLIT)
    for first in range(0, gates, fit):
        yield _table(run, rows, range(first, min(first + fit, gates)))


def top_speeds(run: Run, laps: int) -> list[float]:
    """The fastest instant of each lap, the unfinished one too [m/s]."""
    x = run.telemetry
    speed = (x["vx"] ** 2 + x["vy"] ** 2 + x["vz"] ** 2) ** 0.5
    return [float(speed[x["lap"] == lap].max(initial=0.0)) for lap in range(1, laps + 1)]


def _table(run: Run, rows: list[list[float]], gates: range) -> Table:
    table = plain_table()
    names = ["lap", "time", "top"] if gates.start == 0 else ["lap", "", ""]
    for name in names:
        table.add_column(name, justify="right", min_width=5)
    for gate in gates:
        table.add_column(f"gate {gate + 1}" if gate == gates.start else str(gate + 1), justify="right")
    best = [min((row[g] for row in rows if g < len(row)), default=0.0) for g in gates]
    tops = top_speeds(run, len(rows))
    for i, row in enumerate(rows):
        time = _lap_time(run, i) if gates.start == 0 else ""
        top = f"{tops[i]:.1f}" if gates.start == 0 else ""
        sectors = [_time(row[g], b, len(rows) > 1) if g < len(row) else "" for g, b in zip(gates, best, strict=True)]
        table.add_row(str(i + 1), time, top, *sectors)
    return table


def plain_table(**kwargs: object) -> Table:
    """No lines, a quiet head."""
    return Table(box=None, header_style="dim", padding=(0, 2, 0, 0), **kwargs)  # type: ignore[arg-type]


def _lap_time(run: Run, lap: int) -> str:
    if lap >= len(run.laps):
        return "[dim]-[/]"
    return _time(run.laps[lap], min(run.laps), len(run.laps) > 1)


def _time(t: float, best: float, mark: bool) -> str:
    return f"[green]{t:.3f}[/]" if mark and t == best else f"{t:.3f}"
