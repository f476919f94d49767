"""LapTiming: lap, gate, standing and chatter of a competitor at one instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from quadsim.racing.events import Event, sector_times
from quadsim.record.run import CRASHES
from quadsim.report.metrics import total_variation
from quadsim.web.race.competitor import MISSES, Competitor
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.standings import Standing, Way, standings_at

LAP_MARGIN = 0.02  # time around a lap, so that its frames cover both ends [s]


@dataclass(frozen=True)
class LapTiming:
    """A competitor at one instant."""

    entry: Competitor
    i: int  # frame
    standing: Standing  # in the order of the race
    lap: int
    lap_time: float  # elapsed time of this lap [s]
    gate: int  # the next gate, 1-based; 0: the race is over
    last: float | None  # last lap [s]
    best: float | None  # best lap [s]
    chatter: float  # total variation of the commanded thrust so far [m/s^2/s]
    hits: int
    misses: int
    sectors: list[list[float]]  # seconds from gate to gate, a row a lap
    place: float  # distance along the race [m]
    over: bool  # whether this is the last frame

    @property
    def t(self) -> float:
        """The time of the competitor's frame [s]."""
        return float(self.entry.t[self.i])

    @property
    def is_latest(self) -> bool:
        """Whether this is the last frame so far, to which the last plan belongs."""
        return self.i == len(self.entry.t) - 1

    @property
    def next_gate(self) -> int:
        """The number of the next gate; 0 if the flight is over."""
        return 0 if self.over else self.gate

    @property
    def crash(self) -> Event | None:
        """The event that ended the flight, if that was a crash."""
        if not self.over or self.entry.outcome != "crashed":
            return None
        crashes = [event for event in self.entry.events if event.kind in CRASHES]
        return crashes[-1] if crashes else None


def lap_timings(s: Snapshot) -> list[LapTiming]:
    """Return a LapTiming of each competitor that has a frame, in their order."""
    entries = [entry for entry in s.competitors if len(entry.t)]
    if not entries:
        return []
    standings = standings_at(entries, s.t)
    found = sorted(standings.order, key=lambda one: one.number)
    return [_lap_timing(one.entry, one.entry.at(s.t), one) for one in found]


def at_place_of_first(timings: Sequence[LapTiming]) -> list[LapTiming]:
    """Return the timings with the frames at which all competitors are at the first one's place.

    Only the frames that are drawn change: who leads, and by how much, stays as it is.
    """
    first, *others = timings
    here = float(first.entry.progress[first.i])
    return [first, *(replace(other, i=other.entry.at_place(here)) for other in others)]


def order(timings: Sequence[LapTiming]) -> list[LapTiming]:
    """Return the timings, the leader first."""
    return sorted(timings, key=lambda timing: timing.standing.rank)


def crashed_gates(timings: Sequence[LapTiming]) -> set[int]:
    """Return the 1-based numbers of the gates hit so far."""
    return {
        event.gate
        for timing in timings
        for event in timing.entry.events_until(timing.t)
        if event.kind == "hit"
    }


def _lap_timing(entry: Competitor, i: int, standing: Standing) -> LapTiming:
    """Return the timing of a competitor at its frame i."""
    t = float(entry.t[i])
    gates = entry.legs.gates
    laps = entry.laps_to_fly
    events = entry.events_until(t)
    kinds = [event.kind for event in events]
    done = entry.laps_until(t)
    passed = kinds.count("pass")
    finished = passed == gates * laps
    return LapTiming(
        entry=entry,
        i=i,
        standing=standing,
        lap=min(passed // gates + 1, laps),
        lap_time=done[-1] if finished and done else t - sum(done),
        gate=0 if finished else passed % gates + 1,
        last=done[-1] if done else None,
        best=min(done, default=None),
        chatter=total_variation(entry.t[: i + 1], entry.x["a_cmd"][: i + 1]),
        hits=sum(kinds.count(kind) for kind in CRASHES),
        misses=sum(kinds.count(kind) for kind in MISSES),
        sectors=sector_times(events),
        place=float(entry.progress[i]),
        over=entry.outcome is not None and i == len(entry.t) - 1,
    )


def best_lap(entries: Sequence[Competitor]) -> Way | None:
    """Return the way of the fastest lap of all, from its beginning."""
    best: tuple[float, Competitor, int] | None = None
    # Of laps with equal times, take the first.
    for entry in entries:
        for k, lap in enumerate(entry.laps):
            if best is None or (lap, k) < (best[0], best[2]):
                best = lap, entry, k
    if best is None:
        return None
    _, entry, k = best
    return lap_of(entry, k)


def lap_of(entry: Competitor, k: int, until: int | None = None) -> Way:
    """Return the way of lap k, 0-based, from its beginning. until: the last frame of it."""
    starts = entry.lap_starts
    end = starts[k + 1] if k + 1 < len(starts) else entry.last_t
    inside = (entry.t >= starts[k] - LAP_MARGIN) & (entry.t <= end + LAP_MARGIN)
    rows = np.flatnonzero(inside)
    if until is not None:
        rows = rows[rows <= until]
    lap_begins = [0.0, *entry.legs.lap_ends][k]
    return Way(entry.t[rows] - starts[k], entry.progress[rows] - lap_begins)
