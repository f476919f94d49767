"""The record of one flight, made from its frames and read by reports.

The spec of a run is a JSON dict. This module and the archive read the keys `course` (name and text
of its file), `sampler` (a name), `seed`, `vehicle` (asdict(Vehicle)); `host`, with settings that do
not change a flight (threads, folders); `interactive`, the changes made in flight (see
`not_comparable`); and `own`, the user's own parts. A spec may have more keys.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Any, Literal, NamedTuple, TypedDict, get_args

import numpy as np

from quadsim.controllers.excitation import EXCITE
from quadsim.controllers.plan import PlannerSnapshot
from quadsim.course import Course, parse_course
from quadsim.dynamics.quadrotor import CONTROL_UNITS, STATE_UNITS
from quadsim.physics.plant_state import MOTOR_UNITS
from quadsim.racing.events import Event, Frame, flown_laps, lap_penalties
from quadsim.racing.hand import HAND
from quadsim.record.planner_snapshot import PlannerSnapshots
from quadsim.sensing.estimate_record import ESTIMATE_UNITS
from quadsim.sensing.kept import Kept, kept_arrays

# Key of a spec: the planner's numbers that were changed while it flew
INTERACTIVE = "interactive"
# What was learned in flight: the share that each rotor delivers of its nominal thrust, 1 if it is
# not learned, and a delay of the commands, 0 if none was found
SHARES = ("share1", "share2", "share3", "share4")
LEARNED_UNITS = {**dict.fromkeys(SHARES, "1"), "delay": "s"}
# Telemetry column -> unit, in the order of the digest. Stored runs lack a column that is added
# here, and would be refused; `columns_of` adds columns by a run's settings.
COLUMNS = {
    "t": "s",
    **STATE_UNITS,
    **CONTROL_UNITS,
    "passed": "1",
    "lap": "1",
    "ess": "1",
    "temperature": "1",
    "cost": "1",
    "plan_ms": "ms",
    **LEARNED_UNITS,
}
# Integer columns
COUNTS = ("passed", "lap")
# Columns that differ from flight to flight and do not enter the digest
WALL_CLOCK = ("plan_ms", "estimate_ms")
FIRST_ROWS = 1024
# Difference of a rotor's share from 1 from which a run keeps it
NOTABLE = 0.05
# Kinds of events that may end a flight
CRASHES = ("hit", "ground", "bounds", "wall", "contact")

# "error": an error of the user's own code ended the flight
Outcome = Literal["finished", "crashed", "stuck", "timeout", "interrupted", "error"]
ERROR: Outcome = "error"


class PlanTime(TypedDict):
    """The median and the 95th percentile of a flight's planning times [ms]."""

    p50: float
    p95: float


class LearnedRotor(NamedTuple):
    """A rotor whose estimated thrust differs from the nominal one at the end of a flight."""

    # number from 1, in the order of quadsim.vehicle.Rotors
    rotor: int
    # share of its nominal thrust at the end
    share: float
    # [s]
    since: float


class LearnedDelay(NamedTuple):
    """A delay of the commands that was found in flight, and was there at its end."""

    # [s]
    delay: float
    since: float


class Learned(NamedTuple):
    """The rotors that are found to be weak or strong, and a delay of the commands, if any."""

    rotors: tuple[LearnedRotor, ...] = ()
    delay: LearnedDelay | None = None


def learned_by(telemetry: Mapping[str, np.ndarray], frame: int) -> Learned:
    """Return what a flight has learned of its vehicle by a frame.

    Args:
        telemetry: columns of the flight, or of its beginning.  (frames,)
        frame: index of the frame.
    """
    rotors = []
    for rotor, name in enumerate(SHARES, 1):
        shares = telemetry[name][: frame + 1]
        is_notable = np.abs(shares - 1.0) >= NOTABLE
        if is_notable[-1]:
            since = _since(is_notable, telemetry["t"])
            rotors.append(LearnedRotor(rotor, float(shares[-1]), since))
    delays = telemetry["delay"][: frame + 1]
    delay = float(delays[-1])
    late = LearnedDelay(delay, _since(delays == delay, telemetry["t"])) if delay else None
    return Learned(tuple(rotors), late)


def _since(holds: np.ndarray, t: np.ndarray) -> float:
    """Return the time [s] from which a condition has held, which holds at the last frame."""
    others = np.flatnonzero(~holds)
    return float(t[others[-1] + 1 if len(others) else 0])


class RunError(Exception):
    """An error of a run that cannot be saved or read: the path, the problem and the remedy.

    Examples:
        >>> import quadsim
        >>> try:
        ...     quadsim.load_run("last", runs_dir="nowhere")
        ... except quadsim.RunError as error:
        ...     print(error)
        no runs in 'nowhere': fly one, or give --runs-dir
    """


def columns_of(spec: dict[str, Any]) -> dict[str, str]:
    """Return the unit of each telemetry column of a run by its name, in order.

    A run with sensors has more columns, and so has a run with a firmware.
    """
    columns = dict(COLUMNS)
    if spec.get("sensing"):
        columns |= ESTIMATE_UNITS
    if spec.get("betaflight"):
        columns |= MOTOR_UNITS
    return columns


@dataclass(frozen=True, eq=False, repr=False)
class RecordedRun:
    """A flight as it is stored and reported.

    Laps, splits and penalties are computed from the events, so that they cannot disagree.
    """

    # The resolved configuration, JSON
    spec: dict[str, Any]
    # The columns of `columns_of(spec)`, each (frames,)
    telemetry: dict[str, np.ndarray]
    events: tuple[Event, ...]
    # An Outcome
    outcome: str
    # Wall clock: plan_ms {p50, p95}, real_time_factor
    wall: dict
    snapshots: PlannerSnapshots | None = None
    # Arrays of quadsim.sensing.kept by name, if the flight kept its sensing
    measurements: dict[str, np.ndarray] | None = None
    # The error that ended the flight, on one line; "" if there was none
    fault: str = ""
    # The rotors that were found to be weak or strong
    learned: tuple[LearnedRotor, ...] = ()
    # None: commands came when the planner expected them
    learned_delay: LearnedDelay | None = None

    @classmethod
    def from_frames(cls, spec: dict[str, Any], frames: Iterable[Frame]) -> RecordedRun:
        """Return the run that the frames of a flight make."""
        recorder = Recorder()
        for frame in frames:
            recorder.add(frame)
        return recorder.run(spec)

    @cached_property
    def course(self) -> Course:
        """The course of the planner's map. Raises FileError if the text is not a course."""
        return parse_course(self.spec["course"]["text"], self.course_name)

    @property
    def course_name(self) -> str:
        """The name of the course."""
        return self.spec["course"]["name"]

    @cached_property
    def laps(self) -> list[float]:
        """The times of the completed laps, penalties included [s]."""
        flown = flown_laps(self.events, self._completed)
        return [t + penalty for t, penalty in zip(flown, self.penalties, strict=True)]

    @cached_property
    def penalties(self) -> list[float]:
        """The part of each completed lap's time that was added for hits [s]."""
        return lap_penalties(self.events, self._completed)

    @cached_property
    def gates(self) -> list[dict]:
        """The passes of gates, in order, each a JSON dict.

        Its keys are gate and lap, from 1; t [s]; offset, left and up from the gate's centre [m];
        and speed [m/s].
        """
        passes = [event for event in self.events if event.kind == "pass"]
        return [
            {"gate": e.gate, "lap": e.lap, "t": e.t, "offset": e.offset, "speed": e.speed}
            for e in passes
        ]

    @cached_property
    def duration(self) -> float:
        """The time of the event that ended the flight, or else of the last frame [s]."""
        t = self.telemetry["t"]
        if not len(t):
            return 0.0
        # The event that ended the flight happened within the last control period
        previous = t[-2] if len(t) > 1 else t[-1]
        if self.events and self.outcome != "interrupted" and self.events[-1].t >= previous:
            return self.events[-1].t
        return float(t[-1])

    @cached_property
    def _completed(self) -> int:
        """The number of completed laps in which a pass was recorded."""
        laps = self.telemetry["lap"]
        if not len(laps):
            return 0
        finished = int(laps[-1]) - 1
        if self.outcome == "finished":
            finished += 1
        timed = {event.lap for event in self.events if event.kind == "pass"}
        completed = 0
        while completed < finished and completed + 1 in timed:
            completed += 1
        return completed

    def digest(self) -> str:
        """Return the sha256 [hex] of everything in a run that the seed determines.

        The wall clock, spec["host"], the snapshots and the measurements are left out.
        """
        decided = {
            "spec": hostless(self.spec),
            "events": [event.record() for event in self.events],
            "laps": self.laps,
            "outcome": self.outcome,
        }
        found = sha256(canonical(decided))
        for name in columns_of(self.spec):
            if name not in WALL_CLOCK:
                found.update(self.telemetry[name].astype("<f8").tobytes())
        return found.hexdigest()


def same_flight(one: RecordedRun, other: RecordedRun) -> bool:
    """Return whether two runs have bitwise equal telemetry and events; specs are not compared."""
    if (one.events, one.outcome) != (other.events, other.outcome):
        return False
    columns = [name for name in columns_of(one.spec) if name not in WALL_CLOCK]
    if columns != [name for name in columns_of(other.spec) if name not in WALL_CLOCK]:
        return False
    return all(one.telemetry[name].tobytes() == other.telemetry[name].tobytes() for name in columns)


def own_parts(spec: dict[str, Any]) -> dict[str, str]:
    """Return the class of each of the user's own parts by its role, and the weights of own terms.

    A run with own parts cannot be flown again without them.
    """
    parts = dict(spec.get("own", {}))
    terms = parts.pop("terms", [])
    names = {role: part["class"].rpartition(".")[2] for role, part in parts.items()}
    if terms:
        described = [f"{term['name']} {weight_text(term['weight'])}" for term in terms]
        names["terms"] = ", ".join(described)
    return names


def why_not_repeatable(run: RecordedRun) -> str:
    """Return the reason why the spec alone cannot reproduce a run, "" if it can."""
    spec = run.spec
    if run.outcome == "interrupted":
        return "the flight was interrupted"
    if spec.get(HAND):
        return "a person flew it"
    if spec.get("heat"):
        return "it flew among others in a race"
    if spec.get("clock") == "wall":
        return "planning took time on the wall clock"
    if spec.get("deadline_ms"):
        return "the samples of each plan followed the wall clock"
    if run.outcome == "crashed" and not (run.events and run.events[-1].kind in CRASHES):
        return "the planner raised an error"
    if run.outcome == ERROR:
        return "an error of your own code ended it"
    own = own_parts(spec)
    if own:
        named = ", ".join(f"{role} {name}" for role, name in own.items())
        return f"it needs your own {named}"
    return ""


def weight_text(weight: float | list) -> str:
    """Return a term's weight as a report shows it."""
    return "one for each step" if isinstance(weight, list) else f"{weight:g}"


def has_planner(spec: Mapping[str, Any]) -> bool:
    """Return whether a planner flew, rather than a learned pilot, a person or manoeuvres."""
    return not (spec.get("pilot") or spec.get(HAND) or spec.get(EXCITE))


def flown_by(spec: Mapping[str, Any]) -> str:
    """Return the name of the controller of a flight.

    It is the sampler's name, "pilot", "hand" (a person), "excite" (manoeuvres), or the class of a
    user's own controller. In the last case the spec also names a sampler, which did not fly.
    """
    own = own_parts({"own": spec.get("own", {})})
    return own["controller"] if "controller" in own else spec["sampler"]


def hostless(spec: dict[str, Any]) -> dict:
    """Return the part of a spec that decides a flight."""
    return {key: value for key, value in spec.items() if key != "host"}


def canonical(value: object) -> bytes:
    """Return the canonical JSON text of a value, in which a whole number has no point (60.0 is 60).

    Raises:
        ValueError: the value contains a nan.
        TypeError: the value contains an object that JSON cannot represent.
    """
    same = _whole_numbers_alike(value)
    return json.dumps(same, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def _whole_numbers_alike(value: object) -> object:
    """Return the value with whole floats replaced by ints, and tuples by lists."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if isinstance(value, Mapping):
        return {key: _whole_numbers_alike(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_whole_numbers_alike(item) for item in value]
    return value


class Recorder:
    """A collector of the frames of a flight, about 250 bytes each."""

    def __init__(self) -> None:
        self.last: Frame | None = None
        self.events: list[Event] = []
        # One row a frame, with room for more rows; as wide as the first frame says
        self._table = np.empty((0, 1))
        self._frames = 0
        self._snapshots: list[tuple[int, PlannerSnapshot]] = []
        self._kept: list[Kept] = []

    def add(self, frame: Frame) -> None:
        """Add the next frame of the flight."""
        if frame.snapshot:
            self._snapshots.append((len(self), frame.snapshot))
        if frame.kept:
            self._kept.append(frame.kept)
        row = (
            frame.t,
            *frame.x,
            *frame.u,
            frame.passed,
            frame.lap,
            frame.ess,
            frame.temperature,
            frame.cost,
            frame.plan_ms,
            *frame.rotor_shares,
            frame.learned_delay,
            *frame.estimate,
            *frame.motors,
        )
        if len(self) == len(self._table):
            self._grow(len(row))
        self._table[len(self)] = row
        self.events += frame.events
        self.last = frame
        self._frames += 1

    def __len__(self) -> int:
        return self._frames

    def _grow(self, columns: int) -> None:
        """Replace the table by a larger copy, so that views of the old table do not change."""
        table = np.empty((2 * len(self) or FIRST_ROWS, columns))
        table[: len(self)] = self._table
        self._table = table

    def views(self, columns: Iterable[str]) -> dict[str, np.ndarray]:
        """Return views of the telemetry so far by column  (frames,).

        A view stays valid while the flight continues.

        Args:
            columns: names of the columns, in the order of `columns_of`.
        """
        names = tuple(columns)
        rows = self._table[: len(self)].reshape(len(self), len(names))
        return dict(zip(names, rows.T, strict=True))

    def run(self, spec: dict[str, Any]) -> RecordedRun:
        """Return the flight so far, interrupted if its last frame has no outcome.

        Raises:
            ValueError: the referee's outcome is not an Outcome.
        """
        outcome = "interrupted"
        if self.last and self.last.outcome:
            outcome = self.last.outcome
        if outcome not in get_args(Outcome):
            known = ", ".join(get_args(Outcome))
            raise ValueError(f"referee: expected an outcome of {known}, got {outcome!r}")
        # Tuples become lists now, so that loading gives back the same
        spec = json.loads(json.dumps(spec, allow_nan=False))
        telemetry = {
            name: column.astype(int if name in COUNTS else float)
            for name, column in self.views(columns_of(spec)).items()
        }
        learned = learned_by(telemetry, len(self) - 1) if len(self) else Learned()
        return RecordedRun(
            spec=spec,
            telemetry=telemetry,
            events=tuple(self.events),
            outcome=outcome,
            wall=self._wall(telemetry["plan_ms"]),
            snapshots=PlannerSnapshots.of(self._snapshots),
            measurements=kept_arrays(self._kept) if self._kept else None,
            learned=learned.rotors,
            learned_delay=learned.delay,
        )

    def _wall(self, plan_ms: np.ndarray) -> dict:
        """Return planning times [ms] and the simulated seconds per second of wall clock."""
        plan_time: PlanTime = {"p50": 0.0, "p95": 0.0}
        if len(plan_ms):
            plan_time["p50"] = float(np.percentile(plan_ms, 50))
            plan_time["p95"] = float(np.percentile(plan_ms, 95))
        factor = 0.0
        if self.last and self.last.elapsed > 0.0:
            factor = self.last.t / self.last.elapsed
        return {"plan_ms": plan_time, "real_time_factor": factor}
