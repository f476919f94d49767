"""What happens in a flight: events that the referee calls, a frame for each control step, laps read off the events."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from controllers.plan import PlannerSnapshot

PENALTY = 3.0  # [s] a hit in the timed mode, as AirSim Drone Racing Lab scores


@dataclass(frozen=True, slots=True)
class Event:
    """What the referee reports, at the instant inside a physics step at which it happened."""

    t: float  # [s]
    kind: str  # pass, hit, miss, wrong_way, ground, bounds, timeout, unseen_contact
    gate: int  # 1-based; 0: no gate
    lap: int  # 1-based
    offset: tuple[float, float]  # from the gate's centre: left, up in the gate frame [m]
    speed: float  # [m/s]
    position: tuple[float, float, float]  # ENU [m]


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One control step: the state at t, and the control held from t on."""

    t: float  # [s]
    x: tuple[float, ...]  # STATE at t
    u: tuple[float, ...]  # CONTROL over the following control period
    passed: int  # gates since the start
    lap: int  # 1-based
    gate: int  # 1-based number of the next gate
    ess: float  # effective sample size of the last iteration
    temperature: float
    cost: float  # of the nominal
    plan_ms: float  # wall clock [ms]
    elapsed: float  # wall clock since the flight began [s]
    events: tuple[Event, ...] = ()  # of the physics steps that led to t
    outcome: str | None = None  # None: still flying; finished, crashed, timeout
    snapshot: PlannerSnapshot | None = None  # of the planner, every SNAPSHOT_EVERY periods


def flown_laps(events: Iterable[Event], completed: int) -> list[float]:
    """A lap ends at its last pass; the first begins at t = 0, so that laps sum to the race [s]."""
    ends = {e.lap: e.t for e in events if e.kind == "pass"}
    ends = [0.0, *(ends[lap] for lap in range(1, completed + 1))]
    return [b - a for a, b in pairwise(ends)]


def lap_penalties(events: Iterable[Event], completed: int) -> list[float]:
    """PENALTY for every hit of a completed lap [s]. Only in the timed mode is a lap with a hit ever completed."""
    hits = [e.lap for e in events if e.kind == "hit"]
    return [PENALTY * hits.count(lap) for lap in range(1, completed + 1)]


def sector_times(events: Iterable[Event]) -> list[list[float]]:
    """Flown seconds from gate to gate, one list a lap; they sum to the lap without its penalties."""
    laps: dict[int, list[float]] = {}
    last = 0.0
    for e in events:
        if e.kind == "pass":
            laps.setdefault(e.lap, []).append(e.t - last)
            last = e.t
    return list(laps.values())
