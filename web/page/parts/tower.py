"""The tower: a row of fixed columns for each competitor, the leader first."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import isfinite
from typing import Literal

import msgspec

from quadsim.web.page.parts.elements import rounded
from quadsim.web.page.parts.flight_result import result
from quadsim.web.page.parts.laps import best_sectors
from quadsim.web.page.parts.timing import share_above_limit
from quadsim.web.race.lap_timing import LapTiming, order
from quadsim.web.race.standings import standings_at

FEWEST = 20  # smallest number of frames for the chatter
# intervals that are no number
LEADS = "leads"
LEVEL = "level"

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
        place: in the order of the race; two that ended level have the same one.
        is_recorded: whether it is a stored run beside live flights.
        interval: to the competitor ahead [s] as text.
        gap: to the leader [s] as text.
        time: of this lap, and of the race once it is finished [s] as text; else how it ended.
        above: excess over the best known limit as text; empty: there is none.
        hits, misses: of gates, obstacles and other vehicles, and of gates passed by.
        chatter: total variation of the commanded thrust [m/s^2/s] as text.
        chatter_share: of the largest one.
        progress: flown share of the laps over which the competitors are compared.
        result: how the flight ended; empty: it has not.
        is_out: whether it has ended without the compared laps.
    """

    place: int
    name: str
    colour: str
    dash: tuple[int, ...]
    is_recorded: bool
    lap: str
    interval: str
    gap: str
    last: Time
    best: Time
    time: str
    above: str
    chatter: str
    chatter_share: float
    hits: int
    misses: int
    sectors: list[Sector]
    progress: float
    result: str
    is_out: bool


class Tower(msgspec.Struct):
    """The competitors, the leader first.

    Attributes:
        over: the compared part of the race; empty: the whole race.
        is_final: whether all flights have ended, so that the rows are the result.
    """

    rows: list[TowerRow]
    over: str = ""
    is_final: bool = False


def tower_of(timings: Sequence[LapTiming]) -> Tower:
    """Return the tower."""
    gates = max(s.entry.legs.gates for s in timings)
    best = best_sectors([row for s in timings for row in s.sectors], gates)
    best_lap = min((s.best for s in timings if s.best), default=0.0)
    most = max(s.chatter for s in timings)
    ordered = order(timings)
    has_live = any(s.entry.live for s in timings)
    rows = [_row(s, best_lap, best, most, has_live) for s in ordered]
    for k, (ahead, s) in enumerate(pairwise(ordered), 1):
        if not s.standing.is_level_with(ahead.standing):
            continue
        if s.over and ahead.over:
            rows[k].place = rows[k - 1].place
        if rows[k - 1].interval == LEADS:
            rows[k - 1].interval = LEVEL
    if len(rows) == 1:
        rows[0].interval = ""  # there is no other competitor
    over = standings_at([one.entry for one in timings], timings[0].t).over
    return Tower(rows, over, is_final=all(s.over for s in timings))


def _row(
    s: LapTiming, best_lap: float, best: Sequence[float], most: float, has_live: bool
) -> TowerRow:
    """Return the row of a competitor.

    Args:
        best_lap: the best lap of all [s].
        best: the best time to each gate [s].
        most: the largest chatter [m/s^2/s].
        has_live: whether a competitor is flown now.
    """
    entry = s.entry
    own = s.best or 0.0
    has_chatter = s.i >= FEWEST
    return TowerRow(
        place=s.standing.rank,
        name=entry.name,
        colour=entry.style.colour,
        dash=entry.style.dash,
        is_recorded=has_live and not entry.live,
        lap=f"{s.lap}/{entry.laps_to_fly}",
        interval=_interval(s),
        gap=_behind(s.standing.gap) if s.standing.rank > 1 else "",
        last=_time(s.last, best_lap, own),
        best=_time(s.best, best_lap, own),
        time=_time_or_end(s),
        above=_above(s),
        chatter=f"{s.chatter:.0f}" if has_chatter else "-",
        chatter_share=round(s.chatter / max(most, 1e-9), 2) if has_chatter else 0.0,
        hits=s.hits,
        misses=s.misses,
        sectors=_sectors(s, best),
        progress=round(s.standing.share, 3),
        result=result(s).content if s.over else "",
        is_out=s.standing.is_out,
    )


def _interval(s: LapTiming) -> str:
    """Return the interval of a competitor to the one ahead."""
    if s.standing.is_out:
        return "-"
    if s.standing.rank == 1:
        return LEADS
    return _behind(s.standing.interval)


def _time_or_end(s: LapTiming) -> str:
    """Return the time of the lap, of the race once it is finished, or how the flight ended."""
    if not s.over:
        return f"{rounded(s.lap_time, 2):.2f}"
    if s.entry.outcome == "finished":
        return f"{sum(s.entry.laps):.3f}"
    return "stopped" if s.entry.outcome == "interrupted" else "DNF"


def _above(s: LapTiming) -> str:
    """Return the excess of a finished race over the best known limit as text."""
    share = share_above_limit(s.entry) if s.over else None
    return "" if share is None else f"{share:+.1f} %"


def _behind(seconds: float) -> str:
    if not isfinite(seconds):
        return "-"
    shown = rounded(seconds, 2)
    return f"{shown:+.2f}" if shown > 0 else LEVEL


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
