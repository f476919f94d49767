"""Standings: who leads a race at a time, and by how much, for all parts of the page.

Competitors are compared at one time, over the laps that all of them fly, and by one measure of how
far along the race they are, see quadsim.racing.along.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from quadsim.web.race.competitor import Competitor

# Outcomes that leave the order of a race as it was: the flight was good until it ended.
NOT_OUT = (None, "finished", "interrupted")

LEVEL = 0.005  # gap below which two that fly are level [s]
SAME_RESULT = 0.0005  # difference below which two that finished are level [s]
SAME_PLACE = 0.01  # difference below which two that are out came equally far [m]
SMALL = 0.01  # lead below which it is told in milliseconds [s]


class Way(NamedTuple):
    """The progress of a flight or of a lap over time."""

    t: np.ndarray  # times [s]  (frames,)
    progress: np.ndarray  # distance along the race at these times [m]  (frames,)


@dataclass(frozen=True)
class Standing:
    """A competitor in the order of a race at one time."""

    entry: Competitor
    number: int  # of the competitor on the page, from 0
    rank: int  # from 1
    place: float  # distance along the compared laps [m]
    share: float  # flown share of the compared laps, from 0 to 1
    # of the compared laps, penalties included [s]; None: not completed yet
    time: float | None
    is_out: bool  # whether the flight has ended and did not complete the compared laps
    gap: float  # behind the leader [s]; 0 for the leader; nan: not known yet
    interval: float  # behind the competitor ahead [s], as the gap

    def is_level_with(self, ahead: Standing) -> bool:
        """Return whether the competitor is level with the one ahead of it."""
        if self.is_out or ahead.is_out:
            return self.is_out and ahead.is_out and ahead.place - self.place < SAME_PLACE
        if self.time is not None and ahead.time is not None:
            return self.time - ahead.time < SAME_RESULT
        # Below zero: its last frame is earlier than that of the one ahead.
        return self.time is None and self.interval < LEVEL


@dataclass(frozen=True)
class Standings:
    """The order of a race at one time.

    Attributes:
        laps: number of laps over which the competitors are compared: the fewest that one flies.
        is_partial: whether a competitor flies more laps than are compared.
        order: the standings, the leader first; competitors that are out come last.
    """

    laps: int
    is_partial: bool
    order: tuple[Standing, ...]

    @property
    def going(self) -> tuple[Standing, ...]:
        """The competitors that are not out, the leader first."""
        return tuple(one for one in self.order if not one.is_out)

    @property
    def over(self) -> str:
        """The compared part of the race in words; empty: the whole race of everyone."""
        if not self.is_partial:
            return ""
        return "over the first lap" if self.laps == 1 else f"over the first {self.laps} laps"

    @property
    def headline(self) -> Headline:
        """One sentence with the leader and the lead."""
        first, *others = self.going or self.order
        if first.is_out:
            return _all_out(first, others)
        if not others:
            verb = "flies" if first.time is None else "has finished"
            return Headline(first.entry, verb + (" alone" if len(self.order) > 1 else ""))
        second, *more = others
        has_ended = second.time is not None
        rest = [f"{len(more)} more behind"] if more else []
        out = len(self.order) - len(self.going)
        if out:
            rest.append(f"{out} out")
        behind = f"; {', '.join(rest)}" if rest else ""
        if second.is_level_with(first):
            verb = "finishes level with" if has_ended else "is level with"
            return Headline(first.entry, verb, second.entry, over=self.over, end=behind * has_ended)
        verb = "beats" if has_ended else "leads"
        by = second.gap if np.isfinite(second.gap) else None
        return Headline(first.entry, verb, second.entry, by, self.over, behind)


def _all_out(first: Standing, others: Sequence[Standing]) -> Headline:
    """Return the sentence about a race that nobody finished."""
    if not others:
        return Headline(first.entry, "is out")
    nobody = "; nobody finished"
    if others[0].is_level_with(first):
        return Headline(first.entry, "came as far as", others[0].entry, end=nobody)
    return Headline(first.entry, "came farthest", end=nobody)


class Headline(NamedTuple):
    """One sentence about a race: who leads whom, and by how much."""

    leader: Competitor
    verb: str
    other: Competitor | None = None
    by: float | None = None  # [s]
    over: str = ""  # the compared part of the race, see Standings.over
    end: str = ""  # what follows the sentence

    @property
    def parts(self) -> list[str | Competitor]:
        """The sentence, in which competitors stand for their names."""
        found: list[str | Competitor] = [self.leader, f" {self.verb}"]
        if self.other is not None:
            found += [" ", self.other]
        if self.by is not None:
            # two times that read the same differ by milliseconds
            decimals = 2 if self.by >= SMALL else 3
            found.append(f" by {self.by:.{decimals}f} s")
        if self.over:
            found.append(f" {self.over}")
        return [*found, self.end] if self.end else found

    @property
    def words(self) -> str:
        """The sentence as text."""
        return "".join(part if isinstance(part, str) else part.name for part in self.parts)


class _Reached(NamedTuple):
    """How far a competitor has come at a time."""

    number: int
    entry: Competitor
    t: float  # of its last frame until then [s]
    place: float  # along the compared laps [m]
    time: float | None  # of the compared laps [s]
    is_out: bool

    @property
    def rank(self) -> tuple[bool, bool, float, int]:
        """The key of the order, the smallest first: not out, then done, then by time or place."""
        if self.time is not None:
            return self.is_out, False, self.time, self.number
        return self.is_out, True, -self.place, self.number


def standings_at(entries: Sequence[Competitor], t: float) -> Standings:
    """Return the order of competitors at t [s].

    Args:
        entries: competitors with a frame each, at least one.
        t: time of the race [s].
    """
    laps = min(entry.laps_to_fly for entry in entries)
    found = [_reached(k, entry, laps, t) for k, entry in enumerate(entries)]
    ranked = sorted(found, key=lambda one: one.rank)
    order = []
    for k, one in enumerate(ranked):
        ahead = ranked[max(k - 1, 0)]
        standing = Standing(
            entry=one.entry,
            number=one.number,
            rank=k + 1,
            place=one.place,
            share=max(one.place, 0.0) / float(one.entry.legs.lap_ends[laps - 1]),
            time=one.time,
            is_out=one.is_out,
            gap=_behind(one, ranked[0]),
            interval=_behind(one, ahead),
        )
        order.append(standing)
    is_partial = any(entry.laps_to_fly > laps for entry in entries)
    return Standings(laps, is_partial, tuple(order))


def _reached(number: int, entry: Competitor, laps: int, t: float) -> _Reached:
    """Return how far a competitor has come along the first `laps` laps at t [s]."""
    i = entry.at(t)
    done = entry.laps_until(t)
    end = float(entry.legs.lap_ends[laps - 1])
    time = sum(done[:laps]) if len(done) >= laps else None
    place = end if time is not None else min(float(entry.progress[i]), end)
    has_ended = entry.outcome not in NOT_OUT and i == len(entry.t) - 1
    return _Reached(number, entry, float(entry.t[i]), place, time, has_ended and time is None)


def _behind(one: _Reached, ahead: _Reached) -> float:
    """Return the time by which one competitor is behind another one [s]; nan: not known."""
    if one is ahead:
        return 0.0
    if one.time is not None and ahead.time is not None:
        return one.time - ahead.time
    way = Way(ahead.entry.t, ahead.entry.progress)
    return one.t - float(time_at(np.array([one.place]), way)[0])


def time_at(place: np.ndarray, way: Way) -> np.ndarray:
    """Return the times at which a way first reached places [s]; nan if not reached.  (n,)"""
    # Drop frames without progress, so that the way can be inverted.
    first = np.flatnonzero(np.diff(way.progress, prepend=-np.inf) > 0)
    if not len(first):
        return np.full(len(place), np.nan)
    return np.interp(place, way.progress[first], way.t[first], left=np.nan, right=np.nan)


def gap(place: np.ndarray, way: Way, reference: Way) -> np.ndarray:
    """Return the time behind the reference at each place [s], negative if ahead.  (n,)"""
    return time_at(place, way) - time_at(place, reference)
