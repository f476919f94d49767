"""LapTiming: lap, gate, gap and chatter of a competitor at one instant; gaps at the same place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from quadsim.racing.events import Event, sector_times
from quadsim.record.metrics import total_variation
from web.competitor import CRASHES, MISSES, Competitor
from web.race import Snapshot

LAP_MARGIN = 0.02  # time around a lap, so that its frames cover both ends [s]


class Way(NamedTuple):
    """The progress of a flight or of a lap over time."""

    t: np.ndarray  # times [s]  (frames,)
    progress: np.ndarray  # distance along the race at these times [m]  (frames,)


@dataclass(frozen=True)
class LapTiming:
    """A competitor at one instant."""

    entry: Competitor
    i: int  # frame
    lap: int
    lap_time: float  # elapsed time of this lap [s]
    gate: int  # the next gate, 1-based; 0: the race is over
    gap: float  # behind the leader at the same place [s]; 0 for the leader
    last: float | None  # last lap [s]
    best: float | None  # best lap [s]
    chatter: float  # total variation of the commanded thrust so far [m/s^2/s]
    hits: int
    misses: int
    sectors: list[list[float]]  # seconds from gate to gate, a row a lap
    place: float  # distance along the race [m]
    over: bool  # whether this is the last frame

    @property
    def progress(self) -> float:
        """The finished share of the race."""
        return self.place / self.entry.legs.length

    @property
    def t(self) -> float:
        """The time of its frame [s]."""
        return float(self.entry.t[self.i])

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


def lap_timings(s: Snapshot, by_place: bool) -> list[LapTiming]:
    """Return a LapTiming of each competitor that has a frame, in their order.

    Args:
        by_place: whether to take the other competitors at the place of the first; otherwise all are
            taken at the same time.
    """
    entries = [entry for entry in s.competitors if len(entry.t)]
    if not entries:
        return []
    frames = [entry.at(s.t) for entry in entries]
    if by_place:
        here = float(entries[0].progress[frames[0]])
        frames[1:] = [entry.at_place(here) for entry in entries[1:]]
    leader = _leader(entries, frames)
    return [_lap_timing(entry, i, leader) for entry, i in zip(entries, frames, strict=True)]


def _leader(entries: Sequence[Competitor], frames: Sequence[int]) -> Competitor:
    """Return the competitor that is farthest along; at the same place, the earlier one."""

    def rank(pair: tuple[Competitor, int]) -> tuple[float, float]:
        entry, i = pair
        return float(entry.progress[i]), -float(entry.t[i])

    leader, _ = max(zip(entries, frames, strict=True), key=rank)
    return leader


def order(timings: Sequence[LapTiming]) -> list[LapTiming]:
    """Return the timings, the leader first.

    The leader is farthest along the course, regardless of the numbers of laps.
    """
    return sorted(timings, key=lambda timing: (-timing.place, timing.t))


def crashed_gates(timings: Sequence[LapTiming]) -> set[int]:
    """Return the 1-based numbers of the gates hit so far."""
    return {
        event.gate
        for timing in timings
        for event in timing.entry.events_until(timing.t)
        if event.kind == "hit"
    }


def _lap_timing(entry: Competitor, i: int, leader: Competitor) -> LapTiming:
    """Return the timing of a competitor at its frame i."""
    t = float(entry.t[i])
    gates = entry.legs.gates
    laps = entry.laps_to_fly
    events = entry.events_until(t)
    kinds = [event.kind for event in events]
    done = entry.laps_until(t)
    passed = kinds.count("pass")
    finished = passed == gates * laps
    leader_way = Way(leader.t, leader.progress)
    leader_was_here = time_at(entry.progress[i : i + 1], leader_way)[0]
    return LapTiming(
        entry=entry,
        i=i,
        lap=min(passed // gates + 1, laps),
        lap_time=done[-1] if finished and done else t - sum(done),
        gate=0 if finished else passed % gates + 1,
        gap=0.0 if entry is leader else float(t - leader_was_here),
        last=done[-1] if done else None,
        best=min(done, default=None),
        chatter=total_variation(entry.t[: i + 1], entry.x["a_cmd"][: i + 1]),
        hits=sum(kinds.count(kind) for kind in CRASHES),
        misses=sum(kinds.count(kind) for kind in MISSES),
        sectors=sector_times(events),
        place=float(entry.progress[i]),
        over=entry.outcome is not None and i == len(entry.t) - 1,
    )


def time_at(place: np.ndarray, way: Way) -> np.ndarray:
    """Return the times at which a way first reached places [s]; nan if not reached.  (n,)"""
    # Drop frames without progress, so that the way can be inverted.
    first = np.flatnonzero(np.diff(way.progress, prepend=-1.0) > 0)
    if not len(first):
        return np.full(len(place), np.nan)
    return np.interp(place, way.progress[first], way.t[first], left=np.nan, right=np.nan)


def gap(place: np.ndarray, way: Way, reference: Way) -> np.ndarray:
    """Return the time behind the reference at each place [s], negative if ahead.  (n,)"""
    return time_at(place, way) - time_at(place, reference)


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
