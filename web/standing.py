"""Where every lane stands at one instant: what the head-up display and the timing tower say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from quadsim.metrics import motor_residual, motor_tau
from web.lane import Lane
from web.progress import time_at
from web.race import Snapshot

HITS = ("hit", "ground", "bounds")
RECENT = 400  # frames that the tower's chatter looks back on


@dataclass(frozen=True)
class Standing:
    lane: Lane
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


def standings(s: Snapshot, by_place: bool) -> list[Standing]:
    """In the order of the lanes. by_place: the others are shown where they pass the place of the first."""
    lanes = [lane for lane in s.lanes if len(lane.t)]
    if not lanes:
        return []
    frames = [lane.at(s.t) for lane in lanes]
    if by_place:
        here = float(lanes[0].progress[frames[0]])
        frames[1:] = [lane.at_place(here) for lane in lanes[1:]]
    ahead = max(range(len(lanes)), key=lambda k: (lanes[k].progress[frames[k]], -lanes[k].t[frames[k]]))
    return [_standing(lane, i, lanes[ahead]) for lane, i in zip(lanes, frames, strict=True)]


def order(all_: list[Standing]) -> list[Standing]:
    """The leader first."""
    return sorted(all_, key=lambda s: (-s.progress, s.lane.t[s.i]))


def _standing(lane: Lane, i: int, leader: Lane) -> Standing:
    t = float(lane.t[i])
    done = [lap for lap, end in zip(lane.laps, np.cumsum(lane.laps), strict=True) if end <= t + 1e-9]
    passed = sum(e.kind == "pass" and e.t <= t + 1e-9 for e in lane.events)
    over = lane.outcome is not None and i == len(lane.t) - 1
    finished = passed == lane.legs.gates * lane.spec["laps"]
    return Standing(
        lane=lane,
        i=i,
        lap=min(passed // lane.legs.gates + 1, lane.spec["laps"]),
        lap_time=done[-1] if finished and done else t - sum(done),
        gate=0 if finished else passed % lane.legs.gates + 1,
        gap=0.0 if lane is leader else _gap(lane, i, leader),
        best=min(done, default=None),
        chatter=_chatter(lane, i),
        hits=sum(e.kind in HITS and e.t <= t + 1e-9 for e in lane.events),
        progress=float(lane.progress[i]) / lane.legs.length,
        over=over,
    )


def _gap(lane: Lane, i: int, leader: Lane) -> float:
    there = time_at(lane.progress[i : i + 1], leader.t, leader.progress)
    return float(lane.t[i] - there[0])


def _chatter(lane: Lane, i: int) -> float:
    rows = slice(max(i - RECENT, 0), i + 1)
    if i < 2:
        return 0.0
    return motor_residual(lane.t[rows], lane.x["a_cmd"][rows], motor_tau(lane.spec["vehicle"]))
