"""Sectors: thirds of a lap with the time of every competitor in each, the best in colour."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from quadsim.racing.along import Legs
from quadsim.racing.events import sector_times
from quadsim.web.page.parts.elements import Content, element, heading, label, small, table
from quadsim.web.page.parts.laps import best_sectors, coloured_time
from quadsim.web.race.competitor import Competitor

SECTORS = 3


def sector_ends(legs: Legs, sectors: int = SECTORS) -> list[int]:
    """Return the number of the gate at which each sector of a lap ends; the last one ends the lap.

    Sectors end at the gates nearest to equal shares of the way of a lap after the first. A course
    of few gates has a sector for each gate.
    """
    gates = legs.gates
    if gates <= sectors:
        return list(range(1, gates + 1))
    # A later lap begins at its last gate, the first one at the start
    begins = legs.ends[gates] if len(legs.lap_ends) > 1 else legs.ends[0]
    first = gates + 1 if len(legs.lap_ends) > 1 else 1
    along = legs.ends[first : first + gates] - begins
    ends: list[int] = []
    for k in range(1, sectors):
        # Each sector has at least one gate
        low = (ends[-1] if ends else 0) + 1
        high = gates - (sectors - k)
        nearest = int(np.argmin(np.abs(along - along[-1] * k / sectors))) + 1
        ends.append(min(max(nearest, low), high))
    return [*ends, gates]


def times_of(entry: Competitor, ends: Sequence[int]) -> list[list[float]]:
    """Return the times of the completed sectors [s], one row per lap."""
    rows = []
    for splits in sector_times(entry.events):
        bounds = [0, *(end for end in ends if end <= len(splits))]
        rows.append([sum(splits[a:b]) for a, b in pairwise(bounds)])
    return rows


def sectors(entries: Sequence[Competitor], limit: Competitor | None) -> list[Content]:
    """Return a table of sector times: a row for each lap of each competitor.

    Args:
        entries: the competitors.
        limit: the best known race, shown below and not compared; None: none.
    """
    ends = sector_ends(entries[0].legs)
    times = [times_of(entry, ends) for entry in entries]
    if not any(row for rows in times for row in rows):
        return []
    best = best_sectors([row for rows in times for row in rows], len(ends))
    rows: list[list[Content]] = []
    for entry, laps in zip(entries, times, strict=True):
        own = best_sectors(laps, len(ends))
        for number, found in enumerate(laps, 1):
            cells = [coloured_time(t, b, o) for t, b, o in zip(found, best, own, strict=False)]
            rows.append(_row(label(entry) if number == 1 else "", number, cells, found, ends))
    if all(best):
        cells = [f"{t:.3f}" for t in best]
        rows.append(["best of all", "", *cells, f"{sum(best):.3f}"])
    for number, found in enumerate(times_of(limit, ends) if limit else [], 1):
        cells = [element("span", f"{t:.3f}", look="of-limit") for t in found]
        rows.append(_row("limit" if number == 1 else "", number, cells, found, ends))
    gates = ", ".join(f"S{k} to G{end}" for k, end in enumerate(ends, 1))
    head = ["run", "lap", *(f"S{k}" for k in range(1, len(ends) + 1)), "sum"]
    note = f"{gates}; the sum of a lap without its penalties"
    return [heading("sectors [s]"), table(head, rows), small(note)]


def _row(
    name: Content,
    number: int,
    cells: Sequence[Content],
    times: Sequence[float],
    ends: Sequence[int],
) -> list[Content]:
    """Return the row of a lap, whose sum is left out until its last sector is completed."""
    missing = [""] * (len(ends) - len(cells))
    total = "" if missing else f"{sum(times):.3f}"
    return [name, str(number), *cells, *missing, total]
