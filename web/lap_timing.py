"""LapTiming: lap, gate, gap and chatter of every competitor at one instant; times and gaps at the
same place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from quadsim.race.events import Event, sector_times
from quadsim.record.metrics import total_variation
from web.competitor import CRASHES, Competitor
from web.race import Snapshot

MISSES = ("miss", "wrong_way")  # kinds of events
# times [s] and progress [m] of a flight or a lap, each  (frames,)
Flown = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class LapTiming:
    entry: Competitor
    i: int  # frame
    lap: int
    lap_time: float  # so far in this lap [s]
    gate: int  # next, 1-based; 0: the race is over
    gap: float  # behind the leader at the same place [s]; 0 for the leader
    last: float | None  # lap [s]
    best: float | None  # lap [s]
    chatter: float  # total variation of the commanded thrust so far [m/s^2/s]
    hits: int
    misses: int
    sectors: list[list[float]]  # seconds from gate to gate, a row a lap
    place: float  # how far along the race it is [m]
    over: bool  # its last frame

    @property
    def progress(self) -> float:
        """Share of its race."""
        return self.place / self.entry.legs.length

    @property
    def t(self) -> float:
        """Of its frame [s]."""
        return float(self.entry.t[self.i])

    @property
    def next_gate(self) -> int:
        """0: none is, as the flight is over."""
        return 0 if self.over else self.gate

    @property
    def crash(self) -> Event | None:
        """What ended it, if that was a crash."""
        found = [e for e in self.entry.events if e.kind in CRASHES]
        return found[-1] if found and self.over and self.entry.outcome == "crashed" else None


def lap_timings(s: Snapshot, by_place: bool) -> list[LapTiming]:
    """In the order of the competitors. by_place: the others are shown where they pass the place of
    the first."""
    entries = [e for e in s.competitors if len(e.t)]
    if not entries:
        return []
    frames = [e.at(s.t) for e in entries]
    if by_place:
        here = float(entries[0].progress[frames[0]])
        frames[1:] = [e.at_place(here) for e in entries[1:]]
    pairs = list(zip(entries, frames, strict=True))
    leader, _ = max(pairs, key=lambda pair: (pair[0].progress[pair[1]], -pair[0].t[pair[1]]))
    return [_lap_timing(e, i, leader) for e, i in pairs]


def order(timings: Sequence[LapTiming]) -> list[LapTiming]:
    """The leader first: who is farthest along the course, whatever the number of laps each has to
    fly."""
    return sorted(timings, key=lambda s: (-s.place, s.t))


def crashed_gates(timings: Sequence[LapTiming]) -> set[int]:
    """1-based numbers of the gates hit so far."""
    return {
        e.gate for s in timings for e in s.entry.events if e.kind == "hit" and e.t <= s.t + 1e-9
    }


def _lap_timing(entry: Competitor, i: int, leader: Competitor) -> LapTiming:
    t, gates, laps = float(entry.t[i]), entry.legs.gates, entry.spec["laps"]
    events = [e for e in entry.events if e.t <= t + 1e-9]
    kinds = [e.kind for e in events]
    done = [
        lap for lap, end in zip(entry.laps, entry.lap_starts[1:], strict=True) if end <= t + 1e-9
    ]
    passed = kinds.count("pass")
    finished = passed == gates * laps
    there = time_at(entry.progress[i : i + 1], leader.t, leader.progress)[0]
    return LapTiming(
        entry=entry,
        i=i,
        lap=min(passed // gates + 1, laps),
        lap_time=done[-1] if finished and done else t - sum(done),
        gate=0 if finished else passed % gates + 1,
        gap=0.0 if entry is leader else float(t - there),
        last=done[-1] if done else None,
        best=min(done, default=None),
        chatter=total_variation(entry.t[: i + 1], entry.x["a_cmd"][: i + 1]),
        hits=sum(kinds.count(kind) for kind in CRASHES),
        misses=sum(kinds.count(kind) for kind in MISSES),
        sectors=sector_times(events),
        place=float(entry.progress[i]),
        over=entry.outcome is not None and i == len(entry.t) - 1,
    )


def time_at(place: np.ndarray, t: np.ndarray, progress: np.ndarray) -> np.ndarray:
    """When a flight was first this far along [s]; nan where it has not been.  (n,)"""
    # rows without progress would not be invertible
    first = np.flatnonzero(np.diff(progress, prepend=-1.0) > 0)
    if not len(first):
        return np.full(len(place), np.nan)
    return np.interp(place, progress[first], t[first], left=np.nan, right=np.nan)


def gap(place: np.ndarray, flown: Flown, reference: Flown) -> np.ndarray:
    """Seconds behind the reference at each place; negative is ahead.  (n,)"""
    return time_at(place, *flown) - time_at(place, *reference)


def best_lap(entries: Sequence[Competitor]) -> Flown | None:
    """The fastest lap of all, from its beginning."""
    best = min(
        ((t, k, n) for n, e in enumerate(entries) for k, t in enumerate(e.laps)), default=None
    )
    return lap_of(entries[best[2]], best[1]) if best else None


def lap_of(entry: Competitor, k: int, until: int | None = None) -> Flown:
    """Lap k, 0-based, from its beginning; until: its last frame."""
    t, starts = entry.t, entry.lap_starts
    end = starts[k + 1] if k + 1 < len(starts) else float(t[-1])
    rows = np.flatnonzero((t >= starts[k] - 0.02) & (t <= end + 0.02))
    rows = rows if until is None else rows[rows <= until]
    return t[rows] - starts[k], entry.progress[rows] - [0.0, *entry.legs.lap_ends][k]
