"""Run: what a flight leaves behind. Frames go in, one Run comes out; every number of a report is
read off it.

The spec is a JSON dict. Read here and in the archive: `system`, `course` and `sampler` (names),
`course_text`, `seed`, `vehicle` (asdict(Vehicle)); `host` holds what must not change a flight
(threads, folders); `interactive`, the changes made in flight, see `not_comparable`; `own`, the
user's own parts. There may be more.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from itertools import takewhile
from typing import Literal, TypedDict, get_args

import numpy as np

from controllers.plan import PlannerSnapshot
from quadsim.dynamics.quadrotor import CONTROL_UNITS, STATE_UNITS
from quadsim.race.events import Event, Frame, flown_laps, lap_penalties
from quadsim.record.planner_snapshot import PlannerSnapshots
from quadsim.sensing.estimate_record import ESTIMATE_UNITS

INTERACTIVE = "interactive"  # key of a spec: the planner's numbers that were changed while it flew
COUNTS = ("passed", "lap")  # integer columns
Outcome = Literal["finished", "crashed", "stuck", "timeout", "interrupted"]
# columns that differ from flight to flight and are no part of the digest
WALL_CLOCK = ("plan_ms", "estimate_ms")


class PlanTime(TypedDict):
    """Of a flight's plans: median and 95th percentile [ms]."""

    p50: float
    p95: float


def system_of(spec: dict) -> str | None:
    return "quadrotor"


def telemetry_columns() -> dict[str, str]:
    counted = dict.fromkeys(("passed", "lap", "ess", "temperature", "cost"), "1")
    return {"t": "s", **STATE_UNITS, **CONTROL_UNITS, **counted, "plan_ms": "ms"}


def units_of(spec: dict):
    return STATE_UNITS, CONTROL_UNITS


COLUMNS = telemetry_columns()


def columns_of(spec: dict) -> dict[str, str]:
    """Telemetry column -> unit, in order."""
    return telemetry_columns() | (ESTIMATE_UNITS if spec.get("sensing") else {})


class RunError(Exception):
    """A run that cannot be saved or read. One line: the path, what is wrong, what to do."""


@dataclass(frozen=True, eq=False)
class Run:
    """What a flight leaves behind. Laps, splits and penalties are read off the events, so they
    cannot disagree."""

    spec: dict  # resolved configuration, JSON
    telemetry: dict[str, np.ndarray]  # the columns of its system, each  (frames,)
    events: tuple[Event, ...]
    outcome: str  # an Outcome
    wall: dict  # wall clock: plan_ms {p50, p95}, real_time_factor
    snapshots: PlannerSnapshots | None = None

    @classmethod
    def from_frames(cls, spec: dict, frames: Iterable[Frame]) -> Run:
        """Collect a flight."""
        recorder = Recorder()
        for frame in frames:
            recorder.add(frame)
        return recorder.run(spec)

    @cached_property
    def laps(self) -> list[float]:
        """Completed laps, penalties included [s]."""
        return [
            t + p
            for t, p in zip(flown_laps(self.events, self._completed), self.penalties, strict=True)
        ]

    @cached_property
    def penalties(self) -> list[float]:
        """The part of each completed lap that was added for hits [s]."""
        return lap_penalties(self.events, self._completed)

    @cached_property
    def gates(self) -> list[dict]:
        """The gates passed, in order: gate and lap from 1, t [s], offset (left, up) of the centre
        [m], speed [m/s]."""
        keys = ("gate", "lap", "t", "offset", "speed")
        return [{k: getattr(e, k) for k in keys} for e in self.events if e.kind == "pass"]

    @cached_property
    def duration(self) -> float:
        """Until the event that ended the flight; without one, until the last frame [s]."""
        t = self.telemetry["t"]
        if not len(t):
            return 0.0
        last = self.events[-1].t if self.events and self.outcome != "interrupted" else 0.0
        return last if last >= t[-2:][0] else float(t[-1])

    @cached_property
    def _completed(self) -> int:
        """Laps that were flown to their end, as far as a pass says when that was."""
        laps = self.telemetry["lap"]
        begun = int(laps[-1]) - 1 + (self.outcome == "finished") if len(laps) else 0
        timed = {e.lap for e in self.events if e.kind == "pass"}
        return sum(1 for _ in takewhile(timed.__contains__, range(1, begun + 1)))

    def digest(self) -> str:
        """sha256 [hex] of all that a seed determines: no wall clock, no spec["host"], no
        snapshots."""
        events = [e.record() for e in self.events]
        text = canonical(
            {
                "spec": hostless(self.spec),
                "events": events,
                "laps": self.laps,
                "outcome": self.outcome,
            }
        )
        columns = [
            self.telemetry[name].astype("<f8").tobytes()
            for name in columns_of(self.spec)
            if name not in WALL_CLOCK
        ]
        return sha256(b"".join([text, *columns])).hexdigest()


def own_parts(spec: dict) -> dict[str, str]:
    """Return the user's own objects that took part, role -> class, or names and weights of terms.

    Where there are any, the spec cannot fly the run again.
    """
    parts = dict(spec.get("own", {}))
    terms = parts.pop("terms", [])
    names = {
        role: part.get("class", spec.get("system", "")).rpartition(".")[2]
        for role, part in parts.items()
    }
    if terms:
        names["terms"] = ", ".join(
            f"{term['name']} {weight_text(term['weight'])}" for term in terms
        )
    return names


def weight_text(weight: float | list) -> str:
    """Return a term's weight as a report shows it."""
    return "one for each step" if isinstance(weight, list) else f"{weight:g}"


def flown_with(spec: dict) -> str:
    """What controlled it, with which numbers; the preset and the vehicle of a user's own system are
    its own."""
    own, pilot = own_parts(spec), spec.get("pilot")
    sampled = f"pilot {pilot['name']}" if pilot else f"{spec['sampler']} sampling"
    controlled = f"controller {own['controller']}" if "controller" in own else sampled
    preset = "" if pilot else f", preset {spec['preset']}"
    named = "" if "system" in own else f"{preset}, vehicle {spec['vehicle']['name']}"
    # the others have the same dynamics
    simulator = ", plant rotorpy" if spec.get("plant") == "rotorpy" else ""
    return f"{controlled}{named}{simulator}, seed {spec['seed']}"


def hostless(spec: dict) -> dict:
    """The part of a spec that decides a flight."""
    return {k: v for k, v in spec.items() if k != "host"}


def not_comparable(spec: dict) -> str:
    """What is to be said wherever a run stands beside others that was changed in flight; empty if
    it was not."""
    n = len(spec.get(INTERACTIVE, ()))
    return f"interactive, not comparable: {n} change{'s' * (n > 1)} in flight" if n else ""


def canonical(value: object) -> bytes:
    """One JSON text for one value; raises ValueError on nan and TypeError on what JSON cannot
    hold."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


class Recorder:
    """Collects the frames of a flight, about 250 bytes each."""

    def __init__(self) -> None:
        self.last: Frame | None = None
        self.events: list[Event] = []
        self._table = np.empty((0, 1))  # the system's columns, with room for more rows
        self._frames = 0
        self._snapshots: list[tuple[int, PlannerSnapshot]] = []

    def add(self, f: Frame) -> None:
        if f.snapshot:
            self._snapshots.append((len(self), f.snapshot))
        row = (
            f.t,
            *f.x,
            *f.u,
            f.passed,
            f.lap,
            f.ess,
            f.temperature,
            f.cost,
            f.plan_ms,
            *f.estimate,
        )
        if len(self) == len(self._table):  # a new one, as views of the old one must not change
            table = np.empty((2 * len(self) or 1024, len(row)))
            table[: len(self)] = self._table
            self._table = table
        self._table[len(self)] = row
        self.events += f.events
        self.last = f
        self._frames += 1

    def __len__(self) -> int:
        return self._frames

    def views(self, columns: Iterable[str]) -> dict[str, np.ndarray]:
        """The telemetry so far, not copied; a view stays valid while the flight goes on.  (frames,)
        each"""
        names = tuple(columns)
        return dict(
            zip(names, self._table[: len(self)].reshape(len(self), len(names)).T, strict=True)
        )

    def run(self, spec: dict) -> Run:
        """The flight so far, interrupted where its last frame has no outcome. Raises ValueError for
        any other one."""
        outcome = (self.last.outcome if self.last else None) or "interrupted"
        if outcome not in get_args(Outcome):
            raise ValueError(
                f"referee: expected an outcome of {', '.join(get_args(Outcome))}, got {outcome!r}"
            )
        # tuples become lists now, so that loading gives back the same
        spec = json.loads(canonical(spec))
        views = self.views(columns_of(spec))
        telemetry = {
            name: column.astype(int if name in COUNTS else float) for name, column in views.items()
        }
        return Run(
            spec=spec,
            telemetry=telemetry,
            events=tuple(self.events),
            outcome=outcome,
            wall=self._wall(telemetry["plan_ms"]),
            snapshots=PlannerSnapshots.of(self._snapshots),
        )

    def _wall(self, plan_ms: np.ndarray) -> dict:
        """The real-time factor is simulated over wall-clock seconds."""
        p50, p95 = (
            (float(v) for v in np.percentile(plan_ms, [50, 95])) if len(plan_ms) else (0.0, 0.0)
        )
        timed = self.last is not None and self.last.elapsed > 0.0
        return {
            "plan_ms": {"p50": p50, "p95": p95},
            "real_time_factor": self.last.t / self.last.elapsed if self.last and timed else 0.0,
        }
