"""Records of a flight: events of the referee, a Frame for each control step, lap times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from typing import Any

from quadsim.controllers.plan import PlannerSnapshot
from quadsim.dynamics.rotors import ALL_ONE
from quadsim.sensing.kept import Kept

# [s] A flight is over after this time without getting nearer to the next gate than before.
NO_PROGRESS = 5.0
# Time without progress for a human pilot, who has to find the gate by sight [s]
NO_PROGRESS_BY_HAND = 30.0
# penalty of a hit in the timed mode [s], as in AirSim Drone Racing Lab
PENALTY = 3.0


@dataclass(frozen=True, slots=True)
class Event:
    """An event that the referee reports; its time is resolved within the physics step.

    Examples:
        >>> import quadsim
        >>> run = quadsim.fly("figure8", laps=1, samples=256)
        >>> event = run.events[0]
        >>> event.kind, event.gate, event.lap
        ('pass', 1, 1)
    """

    # [s]
    t: float
    # pass, hit, miss, wrong_way, ground, bounds, stuck, timeout, unseen_contact, contact
    kind: str
    # number of the gate, from 1; 0: no gate
    gate: int
    # number of the lap, from 1
    lap: int
    # distance from the gate's centre, left and up in the gate frame [m]
    offset: tuple[float, float]
    # [m/s]
    speed: float
    # ENU [m]
    position: tuple[float, float, float]
    # number of the obstacle, from 1; 0: no obstacle
    obstacle: int = 0
    # number of a vehicle that took part in the event, from 1; 0 if there was none
    vehicle: int = 0

    @property
    def place(self) -> str:
        """The object of the event: "gate 3", "obstacle 2" or "vehicle 2", "" if there is none."""
        if self.obstacle:
            return f"obstacle {self.obstacle}"
        if self.vehicle:
            return f"vehicle {self.vehicle}"
        if self.gate:
            return f"gate {self.gate}"
        return ""

    def record(self) -> dict[str, Any]:
        """Return the event as JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One control step: the state at t, and the control that is computed from it.

    Examples:
        >>> import quadsim
        >>> frame = next(quadsim.frames("figure8", samples=256))
        >>> frame.t, frame.gate, frame.outcome
        (0.0, 1, None)
    """

    # [s]
    t: float
    # state at t, for a quadrotor as in quadsim.dynamics.quadrotor.STATE_UNITS  (n_x,)
    x: tuple[float, ...]
    # control for the following control period  (n_u,)
    u: tuple[float, ...]
    # gates passed since the start
    passed: int
    # number of the lap, from 1
    lap: int
    # number of the next gate, from 1
    gate: int
    # effective sample size of the last iteration
    ess: float
    # lambda of the last iteration
    temperature: float
    # J of the unperturbed sample of the last iteration
    cost: float
    # planning time, wall clock [ms]
    plan_ms: float
    # wall clock since the start of the simulation [s]
    elapsed: float
    # events of the physics steps since the last frame
    events: tuple[Event, ...] = ()
    # None: still flying; finished, crashed, stuck, timeout
    outcome: str | None = None
    # the planner's best samples, every SNAPSHOT_EVERY periods
    snapshot: PlannerSnapshot | None = field(default=None, repr=False)
    # columns of quadsim.sensing.estimate_record.ESTIMATE_UNITS, if the state is estimated
    estimate: tuple[float, ...] = field(default=(), repr=False)
    # columns of quadsim.physics.plant_state.MOTOR_UNITS, if a firmware commands the motors
    motors: tuple[float, ...] = field(default=(), repr=False)
    # measurements since the last frame, if they are stored (record_sensing)
    kept: Kept | None = field(default=None, repr=False)
    # share that each rotor delivers of its nominal thrust, 1 if it is not estimated  (4,)
    rotor_shares: tuple[float, ...] = field(default=ALL_ONE, repr=False)
    # delay of the commands that was found in flight [s]
    learned_delay: float = field(default=0.0, repr=False)


def flown_laps(events: Iterable[Event], completed: int) -> list[float]:
    """Return the times of the completed laps [s].

    A lap ends at its last gate; the first lap begins at t = 0, so the lap times sum to the race
    time.
    """
    last_pass = {e.lap: e.t for e in events if e.kind == "pass"}
    ends = [0.0, *(last_pass[lap] for lap in range(1, completed + 1))]
    return [end - begin for begin, end in pairwise(ends)]


def lap_penalties(events: Iterable[Event], completed: int) -> list[float]:
    """Return the penalty time of each completed lap [s], PENALTY for every hit.

    Without --penalties a hit ends the flight.
    """
    hits = [e.lap for e in events if e.kind == "hit"]
    return [PENALTY * hits.count(lap) for lap in range(1, completed + 1)]


def sector_times(events: Iterable[Event]) -> list[list[float]]:
    """Return the times from gate to gate [s], one list for each lap.

    The times of a lap sum to its lap time without penalties.
    """
    laps: dict[int, list[float]] = {}
    last = 0.0
    for event in events:
        if event.kind == "pass":
            laps.setdefault(event.lap, []).append(event.t - last)
            last = event.t
    return list(laps.values())
