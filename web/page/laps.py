"""Whole runs as HTML: a table and a strip of lap times, splits by gate, chatter of the thrust.

The best time is purple, a run's own best green.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from quadsim.palette import BEST, FASTER
from quadsim.race.events import sector_times
from quadsim.record.metrics import high_frequency_fraction, motor_corner, motor_tau, total_variation
from quadsim.record.run import not_comparable
from quadsim.record.statistics import mean_interval
from web.competitor import Competitor
from web.page.html import (
    DIM,
    MARKER_EDGE,
    RED,
    TRACK,
    box,
    coloured,
    heading,
    label,
    small,
    svg,
    swatch,
    table,
    text,
)

WIDTH, ROW = 330, 30  # of the strips [px]
GATES = 8  # columns of the split table


def laps(entries: Sequence[Competitor]) -> str:
    if not any(e.events for e in entries):
        return box("no gate passed yet")
    remarks = [
        f"<div>{label(e)} {coloured(not_comparable(e.spec), RED)}</div>"
        for e in entries
        if e.changes
    ]
    parts = [heading("laps [s]"), _table(entries), *remarks, _strips(entries)]
    return box(*parts, heading("splits by gate [s]"), splits(entries))


def _table(entries: Sequence[Competitor]) -> str:
    """Row: run, every lap, their sum, outcome."""
    most = max(e.spec["laps"] for e in entries)
    best = min((t for e in entries for t in e.laps), default=0.0)
    rows = []
    for e in entries:
        times = [coloured_time(t, best, min(e.laps)) for t in e.laps] + ["-"] * (most - len(e.laps))
        rows.append([label(e), *times, f"{sum(e.laps):.3f}", text(e.outcome or "flying")])
    return table(["run", *map(str, range(1, most + 1)), "sum", ""], rows)


def coloured_time(t: float, best: float, own: float, decimals: int = 3) -> str:
    """Purple for the best of all, green for a run's own best."""
    words = f"{t:.{decimals}f}"
    return coloured(words, BEST) if t == best else coloured(words, FASTER) if t == own else words


def _strips(entries: Sequence[Competitor]) -> str:
    """Every lap a dot; the box holds the middle half, the bar is the 95 % interval of the mean."""
    times = [t for e in entries for t in e.laps]
    if len(times) < 2:
        return ""
    low, high = min(times), max(times)
    pad = max(0.08 * (high - low), 0.02)

    def x(t: float) -> float:
        return 8 + (WIDTH - 16) * (t - low + pad) / (high - low + 2 * pad)

    height = ROW * len(entries) + 16
    marks = [_strip(e, ROW * (k + 0.5), x) for k, e in enumerate(entries)]
    for t in np.linspace(low, high, 3):
        marks.append(
            svg(
                "text",
                f"{t:.2f}",
                x=x(t),
                y=height - 3,
                fill=DIM,
                font_size=10,
                text_anchor="middle",
            )
        )
    return svg(
        "svg", "".join(marks), viewBox=f"0 0 {WIDTH} {height}", style="width:100%;margin-top:6px"
    )


def _strip(entry: Competitor, y: float, x: Callable[[float], float]) -> str:
    colour, n = entry.style.colour, len(entry.laps)
    out = svg("line", x1=4, x2=WIDTH - 4, y1=y, y2=y, stroke=TRACK)
    if n >= 3:
        a, b = (x(v) for v in np.percentile(entry.laps, [25, 75]))
        out += svg("rect", x=a, y=y - 8, width=max(b - a, 1.0), height=16, fill=colour, opacity=0.3)
    if n >= 2:
        mean = mean_interval(entry.laps)
        a, m, b = (min(max(x(v), 2.0), WIDTH - 2.0) for v in (mean.low, mean.mean, mean.high))
        out += svg("line", x1=a, x2=b, y1=y, y2=y, stroke=colour, stroke_width=2)
        out += svg("line", x1=m, x2=m, y1=y - 9, y2=y + 9, stroke=colour, stroke_width=2)
    return out + "".join(
        svg("circle", cx=x(t), cy=y, r=4, fill=colour, stroke=MARKER_EDGE) for t in entry.laps
    )


def splits(entries: Sequence[Competitor]) -> str:
    """Seconds from gate to gate, a row a lap."""
    gates = entries[0].legs.gates
    sectors = [sector_times(e.events) for e in entries]
    own = [best_sectors(rows, gates) for rows in sectors]
    best = best_sectors([row for rows in sectors for row in rows], gates)
    parts = []
    for first in range(0, gates, GATES):
        shown, rows = range(first, min(first + GATES, gates)), []
        for e, e_sectors, e_best in zip(entries, sectors, own, strict=True):
            for number, row in enumerate(e_sectors, 1):
                cells = [
                    coloured_time(row[g], best[g], e_best[g], 2) if g < len(row) else ""
                    for g in shown
                ]
                rows.append([swatch(e.style) if number == 1 else "", str(number), *cells])
        parts.append(table(["", "lap", *(f"G{g + 1}" for g in shown)], rows))
    return "".join(parts)


def best_sectors(rows: Sequence[Sequence[float]], gates: int) -> list[float]:
    """The fastest time to each gate [s]; 0 where no row has reached it.  (gates,)"""
    return [min((row[g] for row in rows if g < len(row)), default=0.0) for g in range(gates)]


def chatter(entries: Sequence[Competitor]) -> str:
    """Figures of the whole run so far, for the spectrum's tab; the same as `race show` prints."""
    rows = []
    for e in entries:
        if len(e.t) > 16:
            t, u, a, corner = (
                e.t,
                e.x["a_cmd"],
                e.x["a"],
                motor_corner(motor_tau(e.spec["vehicle"])),
            )
            share = 100 * high_frequency_fraction(t, u, corner)
            rows.append(
                [
                    label(e),
                    *(f"{v:.1f}" for v in (total_variation(t, u), total_variation(t, a), share)),
                ]
            )
    note = (
        "thrust chatter: total variation of the thrust, commanded and delivered [m/s²/s]; share of the commanded "
        "thrust's power above the motors' corner frequency [%]"
    )
    head = ["run", "total variation", "delivered", "above corner [%]"]
    return box(table(head, rows), small(note)) if rows else box("")
