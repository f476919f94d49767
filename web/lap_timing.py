"""Where every competitor stands at one instant: what the head-up display and the timing tower say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadsim.record.metrics import motor_residual, motor_tau
from web.competitor import Competitor
from web.progress import time_at
from web.race import Snapshot

HITS = ("hit", "ground", "bounds")
RECENT = 400  # frames that the tower's chatter looks back on


@dataclass(frozen=True)
class LapTiming:
    competitor: Competitor
    i: int  # frame
    lap: int
    lap_time: float  # so far in this lap [s]
    gate: int  # next, 1-based; 0: the race is over
    gap: float  # behind the leader at the same place [s]; 0 for the leader
    best: float | None  # lap [s]
    chatter: float  # of the commanded thrust, what no motor follows, RMS [m/s^2]
    hits: int
    progress: float  # share of the race
    over: bool


def lap_timings(s: Snapshot, by_place: bool) -> list[LapTiming]:
    """In the order of the competitors. by_place: the others are shown where they pass the place of the first."""
    competitors = [competitor for competitor in s.competitors if len(competitor.t)]
    if not competitors:
        return []
    frames = [competitor.at(s.t) for competitor in competitors]
    if by_place:
        here = float(competitors[0].progress[frames[0]])
        frames[1:] = [competitor.at_place(here) for competitor in competitors[1:]]
    ahead = max(
        range(len(competitors)), key=lambda k: (competitors[k].progress[frames[k]], -competitors[k].t[frames[k]])
    )
    return [_standing(competitor, i, competitors[ahead]) for competitor, i in zip(competitors, frames, strict=True)]


def order(all_: list[LapTiming]) -> list[LapTiming]:
    """The leader first."""
    return sorted(all_, key=lambda s: (-s.progress, s.competitor.t[s.i]))


def _standing(competitor: Competitor, i: int, leader: Competitor) -> LapTiming:
    t = float(competitor.t[i])
    done = [lap for lap, end in zip(competitor.laps, np.cumsum(competitor.laps), strict=True) if end <= t + 1e-9]
    passed = sum(e.kind == "pass" and e.t <= t + 1e-9 for e in competitor.events)
    over = competitor.outcome is not None and i == len(competitor.t) - 1
    finished = passed == competitor.legs.gates * competitor.spec["laps"]
    return LapTiming(
        competitor=competitor,
        i=i,
        lap=min(passed // competitor.legs.gates + 1, competitor.spec["laps"]),
        lap_time=done[-1] if finished and done else t - sum(done),
        gate=0 if finished else passed % competitor.legs.gates + 1,
        gap=0.0 if competitor is leader else _gap(competitor, i, leader),
        best=min(done, default=None),
        chatter=_chatter(competitor, i),
        hits=sum(e.kind in HITS and e.t <= t + 1e-9 for e in competitor.events),
        progress=float(competitor.progress[i]) / competitor.legs.length,
        over=over,
    )


def _gap(competitor: Competitor, i: int, leader: Competitor) -> float:
    there = time_at(competitor.progress[i : i + 1], leader.t, leader.progress)
    return float(competitor.t[i] - there[0])


def _chatter(competitor: Competitor, i: int) -> float:
    rows = slice(max(i - RECENT, 0), i + 1)
    if i < 2:
        return 0.0
    return motor_residual(competitor.t[rows], competitor.x["a_cmd"][rows], motor_tau(competitor.spec["vehicle"]))
