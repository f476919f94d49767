"""Whole runs as elements: a table and a strip of lap times, splits by gate, chatter of the thrust.

The best time is purple, a run's own best green.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from quadsim.racing.events import sector_times
from quadsim.report.metrics import high_frequency_fraction, total_variation
from quadsim.report.run_text import not_comparable
from quadsim.statistics import mean_interval
from quadsim.web.page.parts.elements import (
    EMPTY,
    Content,
    Element,
    bad,
    box,
    element,
    heading,
    label,
    small,
    swatch,
    table,
)
from quadsim.web.race.competitor import Competitor

# sizes of the strips [px]
WIDTH = 330
ROW = 30
GATES = 8  # columns of the split table
FEW_LAPS = 5  # columns of laps that a race has from its start
FEWEST = 16  # smallest number of frames for the chatter


def laps(entries: Sequence[Competitor], sectors: Sequence[Content] = ()) -> Element:
    """Return lap times and splits of runs.

    sectors: what stands between the two.
    """
    if not any(entry.events for entry in entries):
        return box("no gate passed yet")
    parts: list[Content] = [heading("laps [s]"), _table(entries)]
    for entry in entries:
        if entry.changes:
            remark = bad(not_comparable(entry.record))
            parts.append(element("div", label(entry), " ", remark))
    parts += _strips(entries)
    return box(*parts, *sectors, heading("splits by gate [s]"), *splits(entries))


def _table(entries: Sequence[Competitor]) -> Element:
    """Return a row for each run: every lap, their sum, the outcome."""
    asked = max(entry.laps_to_fly for entry in entries)
    begun = max(len(entry.laps) for entry in entries) + 1
    # A long race has a column for each lap that has begun, not for all that are to come.
    most = min(asked, max(begun, FEW_LAPS))
    best = min((lap for entry in entries for lap in entry.laps), default=0.0)
    rows: list[list[Content]] = []
    for entry in entries:
        times = [coloured_time(lap, best, min(entry.laps)) for lap in entry.laps]
        missing = ["-"] * (most - len(times))
        total = f"{sum(entry.laps):.3f}" if entry.laps else "-"
        rows.append([label(entry), *times, *missing, total, _state(entry)])
    return table(["run", *map(str, range(1, most + 1)), "sum", ""], rows)


def _state(entry: Competitor) -> str:
    """Return how a flight ended, or that it is not over at this time."""
    return entry.outcome or ("flying" if entry.live else f"in lap {len(entry.laps) + 1}")


def coloured_time(t: float, best: float, own: float, decimals: int = 3) -> Content:
    """Return a time, purple for the best of all runs, green for a run's own best."""
    shown = f"{t:.{decimals}f}"
    if t == best:
        return element("span", shown, look="best-of-all")
    return element("span", shown, look="own-best") if t == own else shown


class Strips:
    """The scale of the strips of lap times."""

    def __init__(self, times: Sequence[float]):
        self.low = min(times)
        self.high = max(times)
        self._pad = max(0.08 * (self.high - self.low), 0.02)

    def x(self, t: float) -> float:
        """Return the x of a time on the strip [px]."""
        share = (t - self.low + self._pad) / (self.high - self.low + 2 * self._pad)
        return 8 + (WIDTH - 16) * share


def _strips(entries: Sequence[Competitor]) -> list[Content]:
    """Return a strip for each run: each lap a dot, the middle half, the mean's 95 % interval."""
    times = [lap for entry in entries for lap in entry.laps]
    if len(times) < 2:
        return []
    scale = Strips(times)
    height = ROW * len(entries) + 16
    strips = [_strip(entry, ROW * (k + 0.5), scale) for k, entry in enumerate(entries)]
    ticks = [
        element("text", f"{t:.2f}", x=scale.x(t), y=height - 3)
        for t in np.linspace(scale.low, scale.high, 3).tolist()
    ]
    return [element("svg", *strips, *ticks, look="strips", viewBox=f"0 0 {WIDTH} {height}")]


def _strip(entry: Competitor, y: float, scale: Strips) -> Element:
    """Return the strip of a run, with its middle at y [px]."""
    marks = [element("line", look="track", x1=4, x2=WIDTH - 4, y1=y, y2=y)]
    if len(entry.laps) >= 3:
        low, high = (scale.x(t) for t in np.percentile(entry.laps, [25, 75]).tolist())
        width = max(high - low, 1.0)
        marks.append(element("rect", look="half", x=low, y=y - 8, width=width, height=16))
    if len(entry.laps) >= 2:
        interval = mean_interval(entry.laps)
        edges = (interval.low, interval.mean, interval.high)
        low, mean, high = (min(max(scale.x(float(t)), 2.0), WIDTH - 2.0) for t in edges)
        marks.append(element("line", look="interval", x1=low, x2=high, y1=y, y2=y))
        marks.append(element("line", look="interval", x1=mean, x2=mean, y1=y - 9, y2=y + 9))
    marks += [element("circle", cx=scale.x(lap), cy=y, r=4) for lap in entry.laps]
    return element("g", *marks, values={"colour": entry.style.colour})


def splits(entries: Sequence[Competitor]) -> list[Element]:
    """Return the seconds from gate to gate, a row for each lap."""
    gates = entries[0].legs.gates
    sectors = [sector_times(entry.events) for entry in entries]
    best = best_sectors([row for rows in sectors for row in rows], gates)
    parts = []
    for first in range(0, gates, GATES):
        shown = range(first, min(first + GATES, gates))
        rows: list[list[Content]] = []
        for entry, laps in zip(entries, sectors, strict=True):
            own = best_sectors(laps, gates)
            for number, times in enumerate(laps, 1):
                cells = [
                    coloured_time(times[g], best[g], own[g], 2) if g < len(times) else ""
                    for g in shown
                ]
                rows.append([swatch(entry.style) if number == 1 else "", str(number), *cells])
        parts.append(table(["", "lap", *(f"G{g + 1}" for g in shown)], rows))
    return parts


def best_sectors(rows: Sequence[Sequence[float]], gates: int) -> list[float]:
    """Return the fastest time to each gate [s]; 0 if no row has reached it.  (gates,)"""
    return [min((row[g] for row in rows if g < len(row)), default=0.0) for g in range(gates)]


def chatter(entries: Sequence[Competitor]) -> Element:
    """Return the chatter of the run so far, with the numbers of `race show`."""
    rows: list[list[Content]] = []
    for entry in entries:
        if len(entry.t) <= FEWEST:
            continue
        commanded = entry.x["a_cmd"]
        figures = (
            total_variation(entry.t, commanded),
            total_variation(entry.t, entry.x["a"]),
            100 * high_frequency_fraction(entry.t, commanded, entry.motor_corner),
        )
        rows.append([label(entry), *(f"{figure:.1f}" for figure in figures)])
    if not rows:
        return EMPTY
    note = (
        "thrust chatter: total variation of the thrust, commanded and delivered [m/s²/s]; share of "
        "the commanded thrust's power above the motors' corner frequency [%]"
    )
    head = ["run", "total variation", "delivered", "above corner [%]"]
    return box(table(head, rows), small(note))
