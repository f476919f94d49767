"""Laps and gates as HTML: a strip with every lap, box and interval; splits by gate, the best purple, faster green."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from quadsim.palette import BEST, FASTER, HIT, style
from quadsim.race.events import sector_times
from quadsim.record.run import not_comparable
from web.competitor import Competitor
from web.html import DIM, box, coloured, heading, named, svg, swatch, table, text

W, ROW = 330, 30  # of the strips [px]
T95 = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23)  # two-sided, 1 to 10 degrees of freedom
GATES = 8  # columns of the split table


def laps(competitors: Sequence[Competitor]) -> str:
    if not any(competitor.events for competitor in competitors):
        return box("no gate passed yet")
    remarks = "".join(_remark(competitor) for competitor in competitors if competitor.changes)
    tables = _table(competitors), remarks, _strips(competitors), heading("splits by gate [s]"), splits(competitors)
    return box(heading("laps [s]"), *tables)


def _remark(competitor: Competitor) -> str:
    return f"<div>{named(competitor.name, competitor.sampler)} {coloured(not_comparable(competitor.spec), HIT)}</div>"


def _table(competitors: Sequence[Competitor]) -> str:
    """Row: run, every lap, total."""
    most = max(competitor.spec["laps"] for competitor in competitors)
    best = min((t for competitor in competitors for t in competitor.laps), default=0.0)
    rows = []
    for competitor in competitors:
        own = min(competitor.laps, default=0.0)
        cells = [_time(t, best, own) for t in competitor.laps] + ["-"] * (most - len(competitor.laps))
        rows.append(
            [
                named(competitor.name, competitor.sampler),
                *cells,
                f"{sum(competitor.laps):.3f}",
                text(competitor.outcome or "flying"),
            ]
        )
    return table(["run", *map(str, range(1, most + 1)), "sum", ""], rows)


def _time(t: float, best: float, own: float, decimals: int = 3) -> str:
    words = f"{t:.{decimals}f}"
    return coloured(words, BEST) if t == best else coloured(words, FASTER) if t == own else words


def _strips(competitors: Sequence[Competitor]) -> str:
    """Every lap a dot; the box holds the middle half, the bar is the 95 % interval of the mean."""
    times = [t for competitor in competitors for t in competitor.laps]
    if len(times) < 2:
        return ""
    low, high = min(times), max(times)
    pad = max(0.08 * (high - low), 0.02)
    low, high = low - pad, high + pad

    def x(t: float) -> float:
        return 8 + (W - 16) * (t - low) / (high - low)

    height = ROW * len(competitors) + 16
    marks = [_strip(competitor, ROW * (k + 0.5), x) for k, competitor in enumerate(competitors)]
    for t in np.linspace(low + pad, high - pad, 3):
        marks.append(svg("text", f"{t:.2f}", x=x(t), y=height - 3, fill=DIM, font_size=10, text_anchor="middle"))
    return svg("svg", "".join(marks), viewBox=f"0 0 {W} {height}", style="width:100%;margin-top:6px")


def _strip(competitor: Competitor, y: float, x: Callable[[float], float]) -> str:
    colour, n = style(competitor.sampler).colour, len(competitor.laps)
    out = svg("line", x1=4, x2=W - 4, y1=y, y2=y, stroke="#2c3038")
    if n >= 3:
        a, b = (x(v) for v in np.percentile(competitor.laps, [25, 75]))
        out += svg("rect", x=a, y=y - 8, width=max(b - a, 1.0), height=16, fill=colour, opacity=0.3)
    if n >= 2:
        mean = float(np.mean(competitor.laps))
        half = half_interval(competitor.laps)
        a, m, b = (min(max(x(v), 2.0), W - 2.0) for v in (mean - half, mean, mean + half))
        out += svg("line", x1=a, x2=b, y1=y, y2=y, stroke=colour, stroke_width=2)
        out += svg("line", x1=m, x2=m, y1=y - 9, y2=y + 9, stroke=colour, stroke_width=2)
    return out + "".join(svg("circle", cx=x(t), cy=y, r=4, fill=colour, stroke="#111") for t in competitor.laps)


def half_interval(times: Sequence[float]) -> float:
    """Of the mean, by Student's t at 95 % [s]."""
    n = len(times)
    return (T95[n - 2] if n - 2 < len(T95) else 1.96) * float(np.std(times, ddof=1)) / n**0.5


def splits(competitors: Sequence[Competitor]) -> str:
    """Seconds from gate to gate; purple: the best of all runs and laps, green: this run's best."""
    gates = competitors[0].legs.gates
    sectors = [sector_times(competitor.events) for competitor in competitors]
    best = [min((t for rows in sectors for t in _column(rows, g)), default=0.0) for g in range(gates)]
    parts = []
    for first in range(0, gates, GATES):
        shown, rows = range(first, min(first + GATES, gates)), []
        for competitor, laps_ in zip(competitors, sectors, strict=True):
            own = [min(_column(laps_, g), default=0.0) for g in range(gates)]
            for number, row in enumerate(laps_, 1):
                cells = [_time(row[g], best[g], own[g], 2) if g < len(row) else "" for g in shown]
                rows.append([swatch(competitor.sampler) if number == 1 else "", str(number), *cells])
        parts.append(table(["", "lap", *(f"G{g + 1}" for g in shown)], rows))
    return "".join(parts)


def _column(rows: list[list[float]], g: int) -> list[float]:
    return [row[g] for row in rows if g < len(row)]
