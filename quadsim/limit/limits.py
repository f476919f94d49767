"""Stored solutions of `race limit`: read and written as npz, found by course, vehicle and laps.

The optimiser that finds them is quadsim.limit. A LimitProblem names a race; a StoredSolution is the
fastest way known to fly it, with what its check found. Those that come with the project lie in
SOLUTIONS, those found on this machine in the folder LIMITS among the runs.

A file is read where its facts and arrays agree with each other and have plausible values: times up
to 1e4 s, positions up to 1e5 m, speeds up to 1e3 m/s, body rates up to 1e3 rad/s. It counts for a
race where its key is that of the race, and where it leads through the gates.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import cached_property
from hashlib import sha256
from math import hypot, isclose
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np
from msgspec import Meta, Struct

from quadsim.course import Course, Gate, parse_course
from quadsim.course.opening import FRAME_DEPTH, half_depth, half_sizes
from quadsim.dynamics.quadrotor import (
    ATTITUDE,
    BODY_RATES,
    CONTROL,
    POSITION,
    RIGID_BODY,
    VELOCITY,
    Control,
    State,
)
from quadsim.files.arrays import TEXT, Declared, arrays_of, npz_bytes, read_bytes, record_of
from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_errors import shown
from quadsim.vehicle import Vehicle

# Folder of the solutions that come with the project
SOLUTIONS = Path(__file__).parent / "solutions"
# Name of the folder among the runs for those that are found here
LIMITS = "limits"
WHAT = "the solution of a race"
# This ends an error about a file that is named after a race and is no solution of it
ADVICE = "remove the file"
# Size of a file, and of its arrays together [bytes]; twenty laps of many gates take a tenth
LARGEST = 100_000_000
# Greatest absolute value of any state, control and costate
MOST = 1e6
CONTROLS = len(CONTROL)
# States of a vehicle whose rotors follow at once, and of one whose rotors lag
STATES = (RIGID_BODY.stop, RIGID_BODY.stop + 4)
# Arrays of a file: the solution in single precision, and the other fields of a StoredSolution
ARRAYS = {
    "facts": TEXT,
    "t": Declared("float64", ("nodes",), finite=True),
    "x": Declared("float32", ("nodes", "states"), most=MOST),
    "u": Declared("float32", ("intervals", CONTROLS), most=MOST),
    "costate": Declared("float32", ("intervals", "states"), most=MOST),
    "target": Declared("int16", ("intervals",)),
}
# Greatest absolute values of a state's first columns [m, m/s, 1, rad/s]
RANGES = (
    ("position", POSITION, 1e5),
    ("velocity", VELOCITY, 1e3),
    ("attitude", ATTITUDE, 1.01),
    ("body rates", BODY_RATES, 1e3),
)
# Greatest error of |q|
UNIT = 1e-2
# Longest race, and shortest time between two nodes [s]
LONGEST = 1e4
SHORTEST = 1e-7
# Between two nodes a path may differ by this from that of the nodes' mean velocity [m], and by
# this acceleration times the squared interval [m/s^2]
BENT = 0.1
BENDS = 20.0
# Share by which a control may exceed its limit, for rounding
CONTROL_SHARE = 1e-3
# Greatest difference between the lap times and the last node: a race ends just behind a gate [s]
AGREE = 1e-2
# Share of a closed lap for its last gate's exit, at most
CLOSED_SHARE = 0.1
# Rounding of a place in single precision, and of a path between two nodes [m]
ROUNDING = 0.05
# Fields of a course and of a vehicle that change no race
NAMES = ("name", "source", "text", "published", "laps", "loop")

ModelName = Literal["rotors", "rates"]
Name = Annotated[str, Meta(min_length=1, max_length=200)]


class Check(Struct, frozen=True, forbid_unknown_fields=True):
    """The part of a check that readers use, see quadsim.limit.verify.Verified.summary."""

    # Of the nodes from the finely integrated path [m], and their worth in time [s]
    residual: Annotated[float, Meta(ge=0, le=1)]
    worth: Annotated[float, Meta(ge=0, le=LONGEST)]
    attitude: Annotated[float, Meta(ge=0, le=1)]
    # About x, y and z [rad/s]; older files have one number
    body_rate: tuple[float, float, float] | float
    outcome: Literal["finished"]
    # Number of events of each kind
    events: dict[str, Annotated[int, Meta(ge=0)]]
    # One line for each fault
    broken: tuple[str, ...]


class Facts(Struct, frozen=True, forbid_unknown_fields=True):
    """The fields of a StoredSolution in its file, without the arrays."""

    course: Name
    vehicle: Name
    laps: Annotated[int, Meta(ge=1, le=1000)]
    closed: bool
    lap_times: Annotated[tuple[Annotated[float, Meta(gt=0, le=LONGEST)], ...], Meta(min_length=1)]
    verified: Check
    model: ModelName
    margin: Annotated[float, Meta(ge=0, le=100)] = 0.0
    reserve: Annotated[float, Meta(ge=0, lt=1)] = 0.0
    # The problem's key; "" in a file of an earlier version, which has it in its name alone
    key: str = ""


class LimitError(FileError):
    """A solution that cannot be read. One line: the file, what is wrong."""


def limits_folder(runs_dir: str | Path) -> Path:
    """Return the folder of the solutions that are kept among these runs."""
    return Path(runs_dir) / LIMITS


@dataclass(frozen=True, eq=False)
class Solution:
    """A race by its nodes; from one node to the next the control is constant."""

    # "rotors" or "rates", see quadsim.limit.dynamics
    model: str
    # Times of the nodes [s]  (nodes,)
    t: np.ndarray
    # States of the model  (nodes, n_x)
    x: np.ndarray
    # Controls of the model  (nodes - 1, n_u)
    u: np.ndarray
    # Change of the time that is left with the state after each interval [s]  (nodes - 1, n_x)
    costate: np.ndarray
    # Index, from 0, of the target that each interval leads to  (nodes - 1,)
    target: np.ndarray

    @property
    def time(self) -> float:
        """The duration of the race [s]."""
        return float(self.t[-1])

    def position(self, t: np.ndarray) -> np.ndarray:
        """Return positions (n, 3) at times t (n,): cubic between nodes, which have velocities."""
        # Here, as reports load this module and scipy takes .3 s
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self.t, self.x[:, POSITION], self.x[:, VELOCITY])(t)


@dataclass(frozen=True, eq=False)
class StoredSolution:
    """The best solution known of a race, with the summary of its check."""

    # Names of course and vehicle
    course: str
    vehicle: str
    laps: int
    closed: bool
    # Lap times by the referee [s]
    lap_times: list[float]
    # See quadsim.limit.verify.Verified.summary
    verified: dict
    solution: Solution
    # Margin and reserve as in LimitProblem
    margin: float = 0.0
    reserve: float = 0.0
    # The sha256 of the file that it was read from, hexadecimal
    digest: str = ""
    # The problem's key
    key: str = ""

    @property
    def time(self) -> float:
        """The duration of the race by the referee [s]."""
        return sum(self.lap_times)

    def path(self, rate: float = 100.0) -> np.ndarray:
        """Return rows of time [s] and position [m] at this rate [Hz], the end included.  (n, 4)"""
        end = self.solution.t[-1]
        times = np.append(np.arange(0.0, end - 0.5 / rate, 1.0 / rate), end)
        return np.column_stack([times, self.solution.position(times)])

    def states(self, vehicle: Vehicle, t: np.ndarray) -> np.ndarray:
        """Return states in the order of State (n, 17) at times t (n,).

        They are linear between the nodes, but for the position, which is cubic.
        """
        s = self.solution
        thrust = self._thrust(vehicle)
        spin = np.gradient(s.x[:, BODY_RATES], s.t, axis=0)
        at_nodes = np.column_stack([s.x[:, RIGID_BODY], thrust, spin])
        found = np.column_stack([np.interp(t, s.t, column) for column in at_nodes.T])
        found[:, POSITION] = s.position(t)
        return found

    def _thrust(self, vehicle: Vehicle) -> np.ndarray:
        """Return the mass-normalised thrust at the nodes [m/s^2].  (nodes,)"""
        s = self.solution
        controls = np.vstack([s.u, s.u[-1:]])
        # The model's states beside those of the rigid body
        lagging = s.x[:, RIGID_BODY.stop :]
        rotors = vehicle.rotors
        if s.model == "rotors" and rotors:
            # The states are rotor speeds; without lag, the controls are thrusts
            thrusts: Any = rotors.thrust(lagging) if rotors.motor_tau > 0.0 else controls  # pyright: ignore[reportArgumentType]
            return np.sum(thrusts, axis=1) / vehicle.mass
        if lagging.shape[1]:
            return State(*s.x.T).thrust  # pyright: ignore[reportReturnType]
        return Control(*controls.T).thrust  # pyright: ignore[reportReturnType]

    def above(self, time: float) -> float:
        """Return by how much a race's time [s] exceeds this one, as a share."""
        return time / self.time - 1.0


@dataclass(frozen=True)
class LimitProblem:
    """A race whose least time is sought: the key under which its solutions are stored."""

    course: Course
    vehicle: Vehicle
    laps: int
    model: ModelName
    # Whether it is one lap that ends as it begins
    closed: bool = False
    # For a path to be flown: distance kept to the frames within openings [m]
    margin: float = 0.0
    # For a path to be flown: share of the thrust that is left unused
    reserve: float = 0.0

    @property
    def lags(self) -> bool:
        """True if the rotors lag, so that the thrust they deliver is a part of the state."""
        rotors = self.vehicle.rotors
        return rotors is not None and rotors.motor_tau > 0.0

    @classmethod
    def of(cls, course: Course, vehicle: Vehicle, laps: int) -> LimitProblem:
        """Return the problem of a race from a standing start, by the vehicle's rotors if it has."""
        return cls(course, vehicle, laps, "rotors" if vehicle.rotors else "rates")

    @classmethod
    def of_run(cls, spec: dict) -> LimitProblem | None:
        """Return the problem of a run's race, None where a limit would be that of another race.

        That is so for a plant with dynamics of its own, for a user's own plant or referee, and for
        the timed mode.
        """
        own = {"plant", "referee"} & set(spec.get("own", {}))
        if own or spec.get("plant") in ("rotorpy", "crazyflow") or spec.get("penalties"):
            return None
        course = parse_course(spec["course_text"], spec["course"])
        return cls.of(course, msgspec.convert(spec["vehicle"], Vehicle), spec["laps"])

    @cached_property
    def key(self) -> str:
        """The sha256 of all that decides the limit [16 hex digits]."""
        decided = asdict(self) | {"vehicle": asdict(self.vehicle)}
        # Numbers at their defaults do not enter the key.
        for name in ("margin", "reserve"):
            if not decided[name]:
                del decided[name]
        for part in ("course", "vehicle"):
            for name in NAMES:
                decided[part].pop(name, None)
        # How well a vehicle is known does not change what it can do.
        decided["vehicle"].pop("uncertainty", None)
        if not decided["course"]["obstacles"]:
            del decided["course"]["obstacles"]
        for gate in decided["course"]["gates"]:
            if gate["frame_depth"] == FRAME_DEPTH:
                del gate["frame_depth"]
        text = json.dumps(_rounded(decided), sort_keys=True)
        return sha256(text.encode()).hexdigest()[:16]

    @property
    def file_name(self) -> str:
        """The name of the file of its solution, with the key at the end."""
        parts = [self.course.name, self.vehicle.name, str(self.laps)]
        if self.closed:
            parts.append("closed")
        parts.append(self.model)
        if self.margin or self.reserve:
            parts += [f"margin{self.margin:g}", f"reserve{self.reserve:g}"]
        readable = re.sub(r"[^A-Za-z0-9_.-]", "-", "_".join(parts))
        return f"{readable}_{self.key}.npz"

    def best_known(self, *folders: Path) -> StoredSolution | None:
        """Return the fastest solution in these folders or of the project, None where there is none.

        Args:
            folders: see `limits_folder`.

        Raises:
            LimitError: a file is damaged, or the solution of another race.
        """
        return _fastest(self.read(path) for path in self.files(*folders))

    def files(self, *folders: Path) -> list[Path]:
        """Return the files named after this race in the project and in these folders."""
        places = (SOLUTIONS, *folders)
        return [path for folder in places for path in sorted(folder.glob(f"*_{self.key}.npz"))]

    def read(self, path: Path) -> StoredSolution:
        """Read a solution of this race.

        Raises:
            LimitError: the file is damaged, or the solution of another race.
        """
        try:
            facts, stored = _read(path)
        except LimitError as error:
            raise LimitError(f"{error}: {ADVICE}") from None
        solution = stored.solution
        problem = (
            _other_race(self, path, facts)
            or _off_course(self, solution)
            or _beyond_vehicle(self, solution)
        )
        if problem:
            raise LimitError(f"{path}: expected {WHAT}: {problem}: {ADVICE}")
        return stored


def _other_race(problem: LimitProblem, path: Path, facts: Facts) -> str:
    """Return how a solution is not one of this race, "" where it is."""
    if facts.key and facts.key != problem.key:
        other = f"{shown(facts.course)} with {shown(facts.vehicle)}"
        return f"expected the key {problem.key}, got {shown(facts.key)}, the race of {other}"
    names = ["laps", "model", "closed"]
    # A course of the same gates under another name has the same key; the project's own files are
    # what their names say.
    if not facts.key and path.parent != SOLUTIONS:
        names = ["course", "vehicle", *names]
    for name in names:
        wanted = getattr(problem, name)
        wanted = wanted.name if name in ("course", "vehicle") else wanted
        if getattr(facts, name) != wanted:
            return f"{name}: expected {wanted!r}, got {shown(str(getattr(facts, name)))}"
    for name in ("margin", "reserve"):
        if not isclose(getattr(facts, name), getattr(problem, name), rel_tol=1e-6, abs_tol=1e-9):
            return f"{name}: expected {getattr(problem, name):g}, got {getattr(facts, name):g}"
    return ""


def _off_course(problem: LimitProblem, solution: Solution) -> str:
    """Return how a solution does not lead through the gates of a race, "" where it does."""
    gates = problem.course.gates * problem.laps
    targets = int(solution.target[-1]) + 1
    if targets != len(gates):
        return f"target: expected {len(gates)} gates, got {targets}"
    states = STATES[problem.lags]
    if solution.x.shape[1] != states:
        return f"x: expected {states} states of this vehicle, got {solution.x.shape[1]}"

    # The last interval towards a gate ends on the gate's plane or right behind it
    ends = np.searchsorted(solution.target, np.arange(targets), side="right")
    for k, gate in enumerate(gates):
        away = float(np.linalg.norm(solution.x[ends[k], POSITION] - gate.position))
        most = _farthest(gate, problem.vehicle.radius)
        if away > most:
            return f"x: expected at most {most:.2f} m to gate {k + 1}, got {away:.2f} m"
    return ""


def _beyond_vehicle(problem: LimitProblem, solution: Solution) -> str:
    """Return how a solution exceeds the limits of the vehicle's commands, "" where it does not."""
    vehicle = problem.vehicle
    rotors = vehicle.rotors
    if problem.model == "rates":
        high = np.array(Control(*vehicle.omega_max, thrust=vehicle.thrust_max))
        low = -high
        low[-1] = 0.0
    else:
        full = 0.0
        if rotors:
            full = rotors.motor_omega_max if problem.lags else rotors.thrust(rotors.motor_omega_max)
        high = np.full(CONTROLS, full)
        low = np.zeros(CONTROLS)
    room = CONTROL_SHARE * high
    if (solution.u < low - room).any() or (solution.u > high + room).any():
        return "u: expected commands within the vehicle's limits, got one beyond"
    return ""


def _farthest(gate: Gate, radius: float) -> float:
    """Return the greatest distance from a gate's centre at which it can be passed [m]."""
    half = half_sizes(gate.opening)
    return hypot(half.left, half.up, half_depth(radius, depth=gate.frame_depth)) + ROUNDING


def _fastest(found: Iterator[StoredSolution]) -> StoredSolution | None:
    """Return the fastest of these solutions, the first of equal ones, None where there is none."""
    fastest = None
    for stored in found:
        if fastest is None or stored.time < fastest.time:
            fastest = stored
    return fastest


def ignore(_: str) -> None:
    """Ignore a remark."""


def limit_of(
    spec: dict, *folders: Path, remark: Callable[[str], object] = ignore
) -> StoredSolution | None:
    """Return the best solution known of a run's race, None where there is none.

    A damaged file, and a spec that names no race, count as none.

    Args:
        spec: the spec of the run.
        folders: folders to search besides the project's own; see `limits_folder`.
        remark: is called with a line for each file that cannot be read.
    """
    try:
        problem = LimitProblem.of_run(spec)
    except (FileError, KeyError, msgspec.ValidationError):
        return None
    if problem is None:
        return None
    return _fastest(_readable(problem, folders, remark))


def _readable(
    problem: LimitProblem, folders: tuple[Path, ...], remark: Callable[[str], object]
) -> Iterator[StoredSolution]:
    """Yield the solutions of a race that can be read; make a remark for each of the others."""
    for path in problem.files(*folders):
        try:
            yield problem.read(path)
        except LimitError as error:
            remark(str(error))


def dump(stored: StoredSolution) -> bytes:
    """Return the content of a solution's file.

    States are in single precision, whose rounding the check allows for.
    """
    facts = {name: getattr(stored, name) for name in Facts.__struct_fields__ if name != "model"}
    facts["model"] = stored.solution.model
    arrays = {"facts": np.array(json.dumps(facts, allow_nan=False))}
    for name, declared in ARRAYS.items():
        if name != "facts":
            arrays[name] = getattr(stored.solution, name).astype(declared.dtype)
    return npz_bytes(arrays, compressed=True)


def load(path: Path) -> StoredSolution:
    """Read a solution's file.

    Raises:
        LimitError: the file is damaged or no solution.
    """
    return _read(path).stored


class _Read(NamedTuple):
    """The content of a file."""

    facts: Facts
    stored: StoredSolution


def _read(path: Path) -> _Read:
    """Read a solution's file. Raises LimitError."""
    try:
        data = read_bytes(path, WHAT, LARGEST)
        arrays = arrays_of(data, ARRAYS, path, WHAT, LARGEST)
        facts = record_of(arrays.pop("facts"), Facts, path, WHAT)
    except FileError as error:
        raise LimitError(str(error)) from None
    target = arrays.pop("target").astype(int)
    doubles = {name: array.astype(float) for name, array in arrays.items()}
    solution = Solution(facts.model, target=target, **doubles)
    for fault in _faults(facts, solution):
        raise LimitError(f"{path}: expected {WHAT}: {fault}")
    stored = StoredSolution(
        course=facts.course,
        vehicle=facts.vehicle,
        laps=facts.laps,
        closed=facts.closed,
        lap_times=list(facts.lap_times),
        verified=msgspec.to_builtins(facts.verified),
        solution=solution,
        margin=facts.margin,
        reserve=facts.reserve,
        digest=sha256(data).hexdigest(),
        key=facts.key or path.stem.rpartition("_")[2],
    )
    return _Read(facts, stored)


def _faults(facts: Facts, solution: Solution) -> Iterator[str]:
    """Yield all faults of a solution; the first is the one to show."""
    if facts.verified.broken:
        yield f"expected one whose check found no fault, got {shown(facts.verified.broken[0])}"
    if len(facts.lap_times) != facts.laps:
        yield f"lap_times: expected {facts.laps}, got {len(facts.lap_times)}"
    nodes, states = solution.x.shape
    if nodes < 2 or len(solution.u) != nodes - 1:
        yield "expected one interval between any two nodes, its arrays have other lengths"
        return
    if states not in STATES:
        yield f"x: expected {STATES[0]} or {STATES[1]} states, got {states}"
        return
    yield from _faults_of_times(facts, solution.t)
    yield from _faults_of_states(solution.x)
    gap = _gap(solution)
    if gap > 0.0:
        yield f"x: expected positions that follow from the velocities, got {gap:.2g} m too much"
    targets = solution.target
    steps = np.diff(targets)
    if targets[0] != 0 or not np.isin(steps, (0, 1)).all():
        yield "target: expected every gate from the first in its order"
    if (targets[-1] + 1) % facts.laps:
        yield f"target: expected as many gates in each of {facts.laps} laps"


def _faults_of_times(facts: Facts, t: np.ndarray) -> Iterator[str]:
    """Yield the faults of the times of the nodes [s].  (nodes,)"""
    if t[0] != 0.0:
        yield f"t: expected a race that begins at 0 s, got {t[0]:g}"
    if t[-1] > LONGEST:
        yield f"t: expected at most {LONGEST:g} s, got {t[-1]:g}"
    if np.diff(t).min() < SHORTEST:
        yield "t: expected rising times"
    total = sum(facts.lap_times)
    # A closed lap ends behind its last gate, where it began, and the referee's lap on the gate
    early = CLOSED_SHARE * t[-1] if facts.closed else AGREE
    if not -early <= total - t[-1] <= AGREE:
        yield f"lap_times: expected {t[-1]:.3f} s together, as the nodes take, got {total:.3f} s"


def _faults_of_states(x: np.ndarray) -> Iterator[str]:
    """Yield the faults of the states of the nodes.  (nodes, n_x)"""
    for name, columns, most in RANGES:
        greatest = np.abs(x[:, columns]).max()
        if greatest > most:
            yield f"x: {name}: expected numbers up to {most:g}, got {greatest:g}"
    error = np.abs(np.linalg.norm(x[:, ATTITUDE], axis=1) - 1.0).max()
    if error > UNIT:
        yield f"x: attitude: expected |q| = 1 within {UNIT:g}, got a difference of {error:.2g}"


def _gap(solution: Solution) -> float:
    """Return by how much a path is farther than allowed from where its velocities lead [m]."""
    interval = np.diff(solution.t)
    position = solution.x[:, POSITION]
    velocity = solution.x[:, VELOCITY]
    mean = (velocity[1:] + velocity[:-1]) / 2
    off = np.linalg.norm(np.diff(position, axis=0) - mean * interval[:, None], axis=1)
    return float((off - BENT - BENDS * interval**2).max())


def _rounded(value: Any) -> Any:
    """Round all numbers to 9 digits, as the last bits of an angle do not make another course."""
    match value:
        case dict():
            return {key: _rounded(inner) for key, inner in value.items()}
        case list() | tuple():
            return [_rounded(inner) for inner in value]
        case bool():
            return value
        case float() | int():
            return float(f"{value:.9g}")
    return value
