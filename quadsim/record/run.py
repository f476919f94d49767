"""Run: what a flight leaves behind. Frames go in, one Run comes out; every number of a report is read off it.

The spec is a JSON dict. Read here and in the archive: `course` and `sampler` (names), `course_text`, `seed`,
`vehicle` (asdict(Vehicle)); `host` holds what must not change a flight (threads, folders); `interactive`, the changes
made in flight, see `not_comparable`. The rest is free.
"""

from __future__ import annotations

import json
from array import array
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from functools import cached_property
from hashlib import sha256

import numpy as np

from controllers.plan import PlannerSnapshot
from quadsim.race.events import Event, Frame, flown_laps, lap_penalties
from quadsim.race.systems import SYSTEMS, telemetry_columns
from quadsim.record.planner_snapshot import PlannerSnapshots

INTERACTIVE = "interactive"  # key of a spec: the planner's numbers that were changed while it flew
COLUMNS = SYSTEMS["quadrotor"].columns  # telemetry column -> unit
COUNTS = ("passed", "lap")  # integer columns
WALL_CLOCK = ("plan_ms",)  # columns that differ from flight to flight and are no part of the digest


def columns_of(spec: dict) -> dict[str, str]:
    """Telemetry column -> unit, of the system that a spec names; a spec without one is a quadrotor's."""
    own = spec.get("own", {}).get("system")
    if own:
        return telemetry_columns(dict.fromkeys(own["states"], "1"), dict.fromkeys(own["controls"], "1"))
    return SYSTEMS[spec.get("system", "quadrotor")].columns


class RunError(Exception):
    """A run that cannot be saved or read. One line: the path, what is wrong, what to do."""


@dataclass(frozen=True, eq=False)
class Run:
    """What a flight leaves behind. Laps, splits and penalties are read off the events, so they cannot disagree."""

    spec: dict  # resolved configuration, JSON
    telemetry: dict[str, np.ndarray]  # the columns of its system, each  (frames,)
    events: tuple[Event, ...]
    outcome: str  # finished, crashed, stuck, timeout, interrupted
    wall: dict  # wall clock: plan_ms {p50, p95}, real_time_factor
    pictures: PlannerSnapshots | None = None

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
        return [t + p for t, p in zip(flown_laps(self.events, self._completed), self.penalties, strict=True)]

    @cached_property
    def penalties(self) -> list[float]:
        """The part of each completed lap that was added for hits [s]."""
        return lap_penalties(self.events, self._completed)

    @cached_property
    def gates(self) -> list[dict]:
        """The gates passed, in order: gate and lap from 1, t [s], offset (left, up) of the centre [m], speed [m/s]."""
        keys = ("gate", "lap", "t", "offset", "speed")
        return [{k: getattr(e, k) for k in keys} for e in self.events if e.kind == "pass"]

    @property
    def _completed(self) -> int:
        laps = self.telemetry["lap"]
        return int(laps[-1]) - 1 + (self.outcome == "finished") if len(laps) else 0

    def digest(self) -> str:
        """sha256 [hex] of all that a seed determines: no wall clock, no spec["host"], no pictures."""
        events = [asdict(e) for e in self.events]
        text = canonical({"spec": hostless(self.spec), "events": events, "laps": self.laps, "outcome": self.outcome})
        columns = [
            self.telemetry[name].astype("<f8").tobytes() for name in columns_of(self.spec) if name not in WALL_CLOCK
        ]
        return sha256(b"".join([text, *columns])).hexdigest()


def controls_of(spec: dict) -> tuple[str, ...]:
    """Names of the control columns of a spec's system."""
    own = spec.get("own", {}).get("system")
    return tuple(own["controls"] if own else SYSTEMS[spec.get("system", "quadrotor")].controls)


def repeatable(spec: dict) -> bool:
    """Whether the spec alone can fly the run again: no object of the user's own took part."""
    return not spec.get("own")


def hostless(spec: dict) -> dict:
    """The part of a spec that decides a flight."""
    return {k: v for k, v in spec.items() if k != "host"}


def not_comparable(spec: dict) -> str:
    """What is to be said wherever a run stands beside others that was changed in flight; empty if it was not."""
    n = len(spec.get(INTERACTIVE, ()))
    return f"interactive, not comparable: {n} change{'s' * (n > 1)} in flight" if n else ""


def canonical(value: object) -> bytes:
    """One JSON text for one value; raises ValueError on nan and TypeError on what JSON cannot hold."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


class Recorder:
    """Keeps a flight while it goes on: 250 bytes a frame, so that a long one fits as well."""

    def __init__(self) -> None:
        self.last: Frame | None = None
        self.events: list[Event] = []
        self._numbers = array("d")  # rows of the system's columns
        self._frames = 0
        self._pictures: list[tuple[int, PlannerSnapshot]] = []

    def add(self, f: Frame) -> None:
        if f.picture:
            self._pictures.append((len(self), f.picture))
        self._numbers.extend((f.t, *f.x, *f.u, f.passed, f.lap, f.ess, f.temperature, f.cost, f.plan_ms))
        self.events += f.events
        self.last = f
        self._frames += 1

    def __len__(self) -> int:
        return self._frames

    def run(self, spec: dict) -> Run:
        """The flight so far. A last frame without an outcome means that somebody stopped asking: interrupted."""
        spec = json.loads(canonical(spec))  # tuples become lists now, so that loading gives back the same
        columns = columns_of(spec)
        table = np.array(self._numbers).reshape(len(self), len(columns))
        telemetry = {name: table[:, i].astype(int if name in COUNTS else float) for i, name in enumerate(columns)}
        return Run(
            spec=spec,
            telemetry=telemetry,
            events=tuple(self.events),
            outcome=(self.last.outcome if self.last else None) or "interrupted",
            wall=self._wall(telemetry["plan_ms"]),
            pictures=PlannerSnapshots.of(self._pictures),
        )

    def _wall(self, plan_ms: np.ndarray) -> dict:
        """The real-time factor is simulated over wall-clock seconds."""
        p50, p95 = (float(v) for v in np.percentile(plan_ms, [50, 95])) if len(plan_ms) else (0.0, 0.0)
        timed = self.last is not None and self.last.elapsed > 0.0
        return {
            "plan_ms": {"p50": p50, "p95": p95},
            "real_time_factor": self.last.t / self.last.elapsed if self.last and timed else 0.0,
        }
