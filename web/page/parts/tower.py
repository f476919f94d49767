"""The tower: a row of fixed columns for each competitor, the leader first."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Literal

import msgspec

from quadsim.web.page.parts.elements import rounded
from quadsim.web.page.parts.flight_result import result
from quadsim.web.page.parts.laps import best_sectors
from quadsim.web.race.lap_timing import LapTiming, order
from quadsim.web.race.standings import standings_at

FEWEST = 20  # smallest number of frames for the chatter

# the best of all, a run's own best, another one, none yet
Mark = Literal["best", "own", "other", "none"]


class Time(msgspec.Struct):
    """A lap time as text, and how good it is."""

    text: str
    mark: Mark


NO_TIME = Time("-", "none")


class Sector(msgspec.Struct, array_like=True):
    """The way to a gate in this lap."""

    title: str
    mark: Mark


class TowerRow(msgspec.Struct):
    """A competitor.

    Attributes:
        interval: to the competitor ahead [s] as text, or how the flight ended.
        gap: to the leader [s] as text.
        chatter: total variation of the commanded thrust [m/s^2/s] as text.
        chatter_share: of the largest one.
        progress: finished share of the race.
        result: how the flight ended; empty: it has not.
        is_out: whether it has ended without the compared laps.
    """

    place: int
    name: str
    colour: str
    dash: tuple[int, ...]
    lap: str
    interval: str
    gap: str
    last: Time
    best: Time
    chatter: str
    chatter_share: float
    hits: int
    misses: int
    sectors: list[Sector]
    progress: float
    result: str
    is_out: bool


class Tower(msgspec.Struct):
    """The competitors, the leader first. over: the compared part; empty: the whole race."""

    rows: list[TowerRow]
    over: str = ""


def tower_of(timings: Sequence[LapTiming]) -> Tower:
    """Return the tower."""
    gates = max(s.entry.legs.gates for s in timings)
    best = best_sectors([row for s in timings for row in s.sectors], gates)
    best_lap = min((s.best for s in timings if s.best), default=0.0)
    most = max(s.chatter for s in timings)
    rows = [_row(s, best_lap, best, most) for s in order(timings)]
    if len(rows) == 1 and not rows[0].is_out:
        rows[0].interval = ""  # there is no other competitor
    over = standings_at([one.entry for one in timings], timings[0].t).over
    return Tower(rows, over)


def _row(s: LapTiming, best_lap: float, best: Sequence[float], most: float) -> TowerRow:
    """Return the row of a competitor.

    Args:
        best_lap: the best lap of all [s].
        best: the best time to each gate [s].
        most: the largest chatter [m/s^2/s].
    """
    entry = s.entry
    own = s.best or 0.0
    has_chatter = s.i >= FEWEST
    return TowerRow(
        place=s.standing.rank,
        name=entry.name,
        colour=entry.style.colour,
        dash=entry.style.dash,
        lap=f"{s.lap}/{entry.laps_to_fly}",
        interval=_interval(s),
        gap=_behind(s.standing.gap) if s.standing.rank > 1 else "",
        last=_time(s.last, best_lap, own),
        best=_time(s.best, best_lap, own),
        chatter=f"{s.chatter:.0f}" if has_chatter else "-",
        chatter_share=round(s.chatter / max(most, 1e-9), 2) if has_chatter else 0.0,
        hits=s.hits,
        misses=s.misses,
        sectors=_sectors(s, best),
        progress=round(min(s.progress, 1.0), 3),
        result=result(s).content if s.over else "",
        is_out=s.standing.is_out,
    )


def _interval(s: LapTiming) -> str:
    """Return the interval of a competitor to the one ahead."""
    if s.standing.is_out:
        return "DNF"
    if s.standing.rank == 1:
        return "leads"
    return _behind(s.standing.interval)


def _behind(seconds: float) -> str:
    if not isfinite(seconds):
        return "-"
    shown = rounded(seconds, 2)
    return f"{shown:+.2f}" if shown else "level"


def _time(t: float | None, best: float, own: float) -> Time:
    """Return a lap time. best, own: the best of all and a run's own best [s]."""
    if not t:
        return NO_TIME
    mark: Mark = "other"
    if t == best:
        mark = "best"
    elif t == own:
        mark = "own"
    return Time(f"{t:.3f}", mark)


def _sectors(s: LapTiming, best: Sequence[float]) -> list[Sector]:
    """Return the ways to the gates of this lap, by their times relative to the best."""
    own = best_sectors(s.sectors, len(best))
    row = s.sectors[s.lap - 1] if len(s.sectors) >= s.lap else []
    found = []
    for gate in range(len(best)):
        title = f"G{gate + 1}"
        mark: Mark = "none"
        if gate < len(row):
            title += f": {row[gate]:.2f} s"
            mark = "other"
            if row[gate] == own[gate]:
                mark = "own"
            if row[gate] == best[gate]:
                mark = "best"
        found.append(Sector(title, mark))
    return found
