"""Stored solutions of `race limit`: read and written as npz, found by course, vehicle and laps.

The optimiser that finds them is quadsim.limit. A LimitProblem names a race; a StoredSolution is the
fastest way known to fly it, with what its check found. Those that come with the project lie in
SOLUTIONS, those found on this machine in the folder LIMITS among the runs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from quadsim.course import Course, parse_course
from quadsim.dynamics.quadrotor import BODY_RATES, POSITION, RIGID_BODY, VELOCITY, Control, State
from quadsim.files.arrays import TEXT, Declared, arrays_of, npz_bytes, read_bytes, record_of
from quadsim.files.strict_yaml import FileError
from quadsim.vehicle import Vehicle

# Folder of the solutions that come with the project
SOLUTIONS = Path(__file__).parent / "solutions"
# Name of the folder among the runs for those that are found here
LIMITS = "limits"
WHAT = "the solution of a race"
# Arrays of a file: the solution in single precision, and the other fields of a StoredSolution
ARRAYS = {
    "facts": TEXT,
    "t": Declared("float64", ("nodes",), finite=True),
    "x": Declared("float32", ("nodes", "states"), finite=True),
    "u": Declared("float32", ("intervals", "controls"), finite=True),
    "costate": Declared("float32", ("intervals", "states"), finite=True),
    "target": Declared("int16", ("intervals",)),
}
FACTS = (
    "course",
    "vehicle",
    "laps",
    "closed",
    "lap_times",
    "verified",
    "margin",
    "reserve",
    "key",
)
# Fields of a course and of a vehicle that change no race
NAMES = ("name", "source", "text", "published", "laps", "loop")

ModelName = Literal["rotors", "rates"]


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
            thrusts: Any = rotors.thrust(lagging) if rotors.tau > 0.0 else controls  # pyright: ignore[reportArgumentType]
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
        if own or spec.get("plant") == "rotorpy" or spec.get("penalties"):
            return None
        course = parse_course(spec["course_text"], spec["course"])
        return cls.of(course, msgspec.convert(spec["vehicle"], Vehicle), spec["laps"])

    @cached_property
    def key(self) -> str:
        """The sha256 of all that decides the limit [16 hex digits]."""
        decided = asdict(self)
        # Numbers at their defaults do not enter the key.
        for name in ("margin", "reserve"):
            if not decided[name]:
                del decided[name]
        for part in ("course", "vehicle"):
            for name in NAMES:
                decided[part].pop(name, None)
        if not decided["course"]["obstacles"]:
            del decided["course"]["obstacles"]
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
            LimitError: a file cannot be read.
        """
        return min(solutions_of(self.key, *folders), key=lambda found: found.time, default=None)


def solutions_of(key: str, *folders: Path) -> Iterator[StoredSolution]:
    """Yield the solutions of a problem in these folders and of the project.

    Args:
        key: key of the LimitProblem.
        folders: see `limits_folder`.

    Raises:
        LimitError: a file cannot be read.
    """
    for folder in (SOLUTIONS, *folders):
        for path in sorted(folder.glob(f"*_{key}.npz")):
            yield load(path)


def limit_of(spec: dict, *folders: Path) -> StoredSolution | None:
    """Return the best solution known of a run's race, None where there is none.

    A damaged file, and a spec that names no race, count as none.

    Args:
        spec: the spec of the run.
        folders: folders to search besides the project's own; see `limits_folder`.
    """
    with suppress(FileError, KeyError, msgspec.ValidationError):
        problem = LimitProblem.of_run(spec)
        if problem:
            return problem.best_known(*folders)
    return None


def dump(stored: StoredSolution) -> bytes:
    """Return the content of a solution's file.

    States are in single precision, whose rounding the check allows for.
    """
    facts = {name: getattr(stored, name) for name in FACTS} | {"model": stored.solution.model}
    arrays = {"facts": np.array(json.dumps(facts))}
    for name, declared in ARRAYS.items():
        if name != "facts":
            arrays[name] = getattr(stored.solution, name).astype(declared.dtype)
    return npz_bytes(arrays, compressed=True)


def load(path: Path) -> StoredSolution:
    """Read a solution's file.

    Raises:
        LimitError: the file is damaged or no solution.
    """
    try:
        data = read_bytes(path, WHAT)
        arrays = arrays_of(data, ARRAYS, path, WHAT)
        facts = record_of(arrays.pop("facts"), path, WHAT)
    except FileError as error:
        raise LimitError(str(error)) from None
    target = arrays.pop("target").astype(int)
    doubles = {name: array.astype(float) for name, array in arrays.items()}
    try:
        solution = Solution(facts.pop("model"), target=target, **doubles)
        # A file of an earlier version has its key in its name alone
        facts.setdefault("key", path.stem.rpartition("_")[2])
        digest = sha256(data).hexdigest()
        stored = StoredSolution(**facts, solution=solution, digest=digest)
        _check_nodes(solution)
    except (KeyError, TypeError, ValueError) as error:
        raise LimitError(f"{path}: expected {WHAT}: {error}") from None
    return stored


def _check_nodes(solution: Solution) -> None:
    """Raise ValueError unless intervals lie between the nodes and times rise."""
    intervals = len(solution.t) - 1
    if intervals < 1 or len(solution.u) != intervals:
        raise ValueError("its arrays are not of one length")
    if not (np.diff(solution.t) > 0.0).all():
        raise ValueError("expected rising times")


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
