"""Laps and gates as HTML: a strip with every lap, box and interval; splits by gate, the best purple, faster green."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from quadsim.palette import BEST, FASTER, style
from quadsim.run import sector_times
from web.html import DIM, box, coloured, heading, named, table
from web.lane import Lane

W, ROW = 330, 30  # of the strips [px]
T95 = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23)  # two-sided, 1 to 10 degrees of freedom
GATES = 8  # columns of the split table


def laps(lanes: Sequence[Lane]) -> str:
    if not any(lane.events for lane in lanes):
        return box("no gate passed yet")
    return box(heading("laps [s]"), _table(lanes), _strips(lanes), heading("splits by gate [s]"), splits(lanes))


def _table(lanes: Sequence[Lane]) -> str:
    """Row: run, every lap, total."""
    most = max(lane.spec["laps"] for lane in lanes)
    best = min((t for lane in lanes for t in lane.laps), default=0.0)
    rows = []
    for lane in lanes:
        own = min(lane.laps, default=0.0)
        cells = [_time(t, best, own) for t in lane.laps] + ["-"] * (most - len(lane.laps))
        rows.append([named(lane.name, lane.sampler), *cells, f"{sum(lane.laps):.3f}", lane.outcome or "flying"])
    return table(["run", *map(str, range(1, most + 1)), "sum", ""], rows)


def _time(t: float, best: float, own: float) -> str:
    if t == best:
        return coloured(f"{t:.3f}", BEST)
    return coloured(f"{t:.3f}", FASTER) if t == own else f"{t:.3f}"


def _strips(lanes: Sequence[Lane]) -> str:
    """Every lap a dot; the box holds the middle half, the bar is the 95 % interval of the mean."""
    times = [t for lane in lanes for t in lane.laps]
    if len(times) < 2:
        return ""
    low, high = min(times), max(times)
    pad = max(0.08 * (high - low), 0.02)
    low, high = low - pad, high + pad
    x = lambda t: 8 + (W - 16) * (t - low) / (high - low)  # noqa: E731
    marks = "".join(_strip(lane, k, x) for k, lane in enumerate(lanes))
    height = ROW * len(lanes) + 16
    ticks = "".join(
        f'<text x="{x(t):.0f}" y="{height - 3}" fill="{DIM}" font-size="10" text-anchor="middle">{t:.2f}</text>'
        for t in np.linspace(low + pad, high - pad, 3)
    )
    return f'<svg viewBox="0 0 {W} {height}" style="width:100%;margin-top:6px">{marks}{ticks}</svg>'


def _strip(lane: Lane, k: int, x) -> str:
    y, s = ROW * k + ROW / 2, style(lane.sampler)
    out = f'<line x1="4" x2="{W - 4}" y1="{y}" y2="{y}" stroke="#2c3038"/>'
    n = len(lane.laps)
    if n >= 3:
        a, b = (x(v) for v in np.percentile(lane.laps, [25, 75]))
        out += (
            f'<rect x="{a:.1f}" y="{y - 8}" width="{max(b - a, 1):.1f}" height="16" fill="{s.colour}" opacity=".25"/>'
        )
    if n >= 2:
        mean = float(np.mean(lane.laps))
        half = (T95[n - 2] if n - 2 < len(T95) else 1.96) * float(np.std(lane.laps, ddof=1)) / n**0.5
        a, m, b = (min(max(x(v), 2), W - 2) for v in (mean - half, mean, mean + half))
        out += f'<line x1="{a:.1f}" x2="{b:.1f}" y1="{y}" y2="{y}" stroke="{s.colour}" stroke-width="2"/>'
        out += f'<line x1="{m:.1f}" x2="{m:.1f}" y1="{y - 9}" y2="{y + 9}" stroke="{s.colour}" stroke-width="2"/>'
    return out + "".join(f'<circle cx="{x(t):.1f}" cy="{y}" r="4" fill="{s.colour}" stroke="#111"/>' for t in lane.laps)


def splits(lanes: Sequence[Lane]) -> str:
    """Seconds from gate to gate; purple: the best of all runs and laps, green: this run's best."""
    gates = lanes[0].legs.gates
    sectors = [sector_times(lane.events) for lane in lanes]
    column = lambda rows, g: [row[g] for row in rows if g < len(row)]  # noqa: E731
    best = [min((t for rows in sectors for t in column(rows, g)), default=0.0) for g in range(gates)]
    parts = []
    for first in range(0, gates, GATES):
        shown, rows = range(first, min(first + GATES, gates)), []
        for lane, laps_ in zip(lanes, sectors, strict=True):
            own = [min(column(laps_, g), default=0.0) for g in range(gates)]
            for number, row in enumerate(laps_, 1):
                cells = [_time(row[g], best[g], own[g]) if g < len(row) else "" for g in shown]
                rows.append([named(lane.name, lane.sampler) if number == 1 else "", str(number), *cells])
        parts.append(table(["run", "lap", *(f"G{g + 1}" for g in shown)], rows))
    return "".join(parts)
