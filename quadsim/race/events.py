"""Records of a flight: the referee's events, a frame for each control step; lap times computed from
the events."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from itertools import pairwise

from controllers.plan import PlannerSnapshot

# [s] without getting nearer to the next gate than before, after which a flight is over
NO_PROGRESS = 5.0
PENALTY = 3.0  # [s] a hit in the timed mode, as AirSim Drone Racing Lab scores


@dataclass(frozen=True, slots=True)
class Event:
    """An event that the referee reports; its time is resolved within the physics step."""

    t: float  # [s]
    kind: str  # pass, hit, miss, wrong_way, ground, bounds, stuck, timeout, unseen_contact
    gate: int  # 1-based; 0: no gate
    lap: int  # 1-based
    offset: tuple[float, float]  # from the gate's centre: left, up in the gate frame [m]
    speed: float  # [m/s]
    position: tuple[float, float, float]  # ENU [m]
    obstacle: int = 0  # 1-based; 0: none

    @property
    def place(self) -> str:
        """ "gate 3", "obstacle 2", or "" for an event at neither."""
        return (
            f"obstacle {self.obstacle}"
            if self.obstacle
            else f"gate {self.gate}"
            if self.gate
            else ""
        )

    def record(self) -> dict:
        """As JSON; an event of no obstacle does not say so, as before there were any."""
        return {k: v for k, v in asdict(self).items() if v or k != "obstacle"}


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One control step: the state at t, and the control that is computed from it."""

    t: float  # [s]
    x: tuple[float, ...]  # state at t, see the system's STATE_UNITS
    u: tuple[float, ...]  # control for the following control period
    passed: int  # gates passed since the start
    lap: int  # 1-based
    gate: int  # 1-based number of the next gate
    ess: float  # effective sample size of the last iteration
    temperature: float  # lambda of the last iteration
    cost: float  # J of the unperturbed sample of the last iteration
    plan_ms: float  # planning time, wall clock [ms]
    elapsed: float  # wall clock since the start of the simulation [s]
    events: tuple[Event, ...] = ()  # of the physics steps that led to t
    outcome: str | None = None  # None: still flying; finished, crashed, stuck, timeout
    # the planner's best samples, every SNAPSHOT_EVERY periods
    snapshot: PlannerSnapshot | None = None
    # of quadsim.sensing.estimate_record.ESTIMATE_UNITS, where the state is sensed
    estimate: tuple[float, ...] = ()


def flown_laps(events: Iterable[Event], completed: int) -> list[float]:
    """Lap times [s]. A lap ends at its last gate; the first begins at t = 0, so that the laps sum
    to the race time."""
    ends = {e.lap: e.t for e in events if e.kind == "pass"}
    ends = [0.0, *(ends[lap] for lap in range(1, completed + 1))]
    return [b - a for a, b in pairwise(ends)]


def lap_penalties(events: Iterable[Event], completed: int) -> list[float]:
    """Penalty time of each completed lap [s]: PENALTY for every hit. Without --penalties a hit ends
    the flight."""
    hits = [e.lap for e in events if e.kind == "hit"]
    return [PENALTY * hits.count(lap) for lap in range(1, completed + 1)]


def sector_times(events: Iterable[Event]) -> list[list[float]]:
    """Time from gate to gate [s], one list per lap; they sum to the lap time without penalties."""
    laps: dict[int, list[float]] = {}
    last = 0.0
    for e in events:
        if e.kind == "pass":
            laps.setdefault(e.lap, []).append(e.t - last)
            last = e.t
    return list(laps.values())
