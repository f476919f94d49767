"""The flights of a series so far, for the tab Seeds."""

from __future__ import annotations

from math import isfinite

import msgspec

from quadsim.statistics import Mean
from quadsim.web.page.parts.head import Word
from quadsim.web.race.series import Series

ALIKE = "a competitor flies the same with every seed: Randomize varies start, vehicle and gusts"


class SeedsRow(msgspec.Struct):
    """A competitor: its flights and, as text, means with the halves of their 95 % intervals."""

    name: str
    colour: str
    finished: str
    time: str  # [s]
    chatter: str  # [m/s^2/s]
    times: list[str]  # of each seed [s]


class SeedsPair(msgspec.Struct):
    """The second competitor less the first, over the seeds that both finished, as text."""

    names: list[str]
    colours: list[str]
    difference: str


class Seeds(msgspec.Struct):
    """A series.

    Attributes:
        said: how far it is, in words; empty: there is none.
        headline: which competitor is faster, and by how much.
        seeds: that all have flown.
    """

    said: str
    headline: list[Word]
    seeds: list[int]
    rows: list[SeedsRow]
    pairs: list[SeedsPair]


def seeds_of(series: Series) -> Seeds:
    """Return the table of a series."""
    if series.count < 2:
        return Seeds("", [], [], [], [])
    said = f"seed {min(series.done + 1, series.count)} of {series.count}"
    if not series.is_on:
        said = f"{series.done} of {series.count} seeds flown"
    if any(row.is_repeated for row in series.rows):
        said += f"; {ALIKE}"
    rows = [
        SeedsRow(
            name=row.name,
            colour=row.colour,
            finished=f"{len(row.times)}/{len(row.flights)}",
            time=_interval(row.time, 3),
            chatter=_interval(row.chatter, 1),
            times=["-" if one.time is None else f"{one.time:.3f}" for one in row.flights],
        )
        for row in series.rows
    ]
    pairs = [
        SeedsPair(
            names=[pair.second.name, pair.first.name],
            colours=[pair.second.colour, pair.first.colour],
            difference=_interval(pair.difference, 3, sign="+"),
        )
        for pair in series.pairs
        if pair.difference.n
    ]
    seeds = [one.seed for row in series.rows[:1] for one in row.flights]
    return Seeds(said, headline_of(series), seeds, rows, pairs)


def headline_of(series: Series) -> list[Word]:
    """Return one sentence with the faster of the two fastest competitors, and by how much."""
    pair = series.first_pair
    if pair is None:
        return []
    first, second = (Word(row.name, row.colour) for row in (pair.first, pair.second))
    mean = pair.difference
    over = Word(f" over {_count(mean.n, series.done)}")
    if mean.low <= 0.0 <= mean.high:
        difference = Word(f" are not told apart: {_interval(mean, 2)} s")
        return [first, Word(" and "), second, difference, over]
    return [first, Word(f" is faster by {_interval(mean, 2)} s"), over]


def _count(both: int, done: int) -> str:
    return f"{both} seeds" if both == done else f"the {both} of {done} seeds that both finished"


def _interval(mean: Mean, digits: int, sign: str = "") -> str:
    """Return a mean with the half of its interval; "-": there is none yet."""
    if not mean.n:
        return "-"
    value = f"{mean.mean:{sign}.{digits}f}"
    half = (mean.high - mean.low) / 2
    return f"{value} \u00b1 {half:.{digits}f}" if isfinite(half) else value
