"""Stored solutions of `race limit`: npz files that are found by course, vehicle and laps.

The optimiser that finds them is quadsim.limit.search. A LimitProblem describes a race; a
StoredSolution is its fastest known flight, with the findings of the check. Solutions that come with
the project are in the folder SOLUTIONS, solutions found on this machine in the folder LIMITS of the
runs.

A file has the key of its problem and the sha256 of its content, by which damage is detected. A
solution is checked only before it is stored.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np
from msgspec import Struct

from quadsim.course import Course, Cylinder, Gate, Obstacle, parse_course
from quadsim.dynamics.quadrotor import (
    BODY_RATES,
    CONTROL,
    POSITION,
    RIGID_BODY,
    VELOCITY,
    Control,
    State,
)
from quadsim.files.arrays import (
    TEXT,
    Declared,
    arrays_of,
    expect_format,
    npz_bytes,
    read_bytes,
    record_of,
)
from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_errors import shown
from quadsim.vehicle import Vehicle

# Folder of the solutions that come with the project
SOLUTIONS = Path(__file__).parent / "solutions"
# Name of the folder among the runs for solutions that are found here
LIMITS = "limits"
# Format of the files; another content needs another number
FORMAT = "quadsim solution 1"
WHAT = "the solution of a race"
# This ends an error about a file that is named after a race and is no solution of it
ADVICE = "remove the file"
# Size of a file, and of its arrays together [bytes]; twenty laps of many gates take a tenth
LARGEST = 100_000_000
# Arrays of a file: the fields of Facts, the sha256 of all other arrays, and the solution in single
# precision, whose rounding the check allows for
FACTS = "facts"
HASH = "sha256"
NODES = {
    "t": Declared("float64", ("nodes",)),
    "x": Declared("float32", ("nodes", "states")),
    "u": Declared("float32", ("intervals", len(CONTROL))),
    "costate": Declared("float32", ("intervals", "states")),
    "target": Declared("int16", ("intervals",)),
}
ARRAYS = {FACTS: TEXT, HASH: TEXT._replace(required=False), **NODES}

ModelName = Literal["rotors", "rates"]


class Check(Struct, frozen=True):
    """The findings of the check of a solution, see quadsim.limit.verify.Verified.summary."""

    # Largest distance from a node to the finely integrated path before it [m]
    residual: float
    # Value of all these distances in time [s]
    worth: float
    # Largest error of |q|
    attitude: float
    # Largest body rates about x, y and z [rad/s]
    body_rate: tuple[float, float, float]
    # Outcome of the referee
    outcome: str | None
    # Number of the referee's events of each kind
    events: dict[str, int]
    # One line for each fault
    broken: tuple[str, ...]


class Facts(Struct, frozen=True, kw_only=True):
    """The fields of a StoredSolution in its file, without the arrays."""

    format: str = FORMAT
    key: str
    course: str
    vehicle: str
    laps: int
    closed: bool
    model: ModelName
    margin: float
    reserve: float
    lap_times: tuple[float, ...]
    verified: Check


class LimitError(FileError):
    """An error of a solution that cannot be read: the file and the problem."""


def limits_folder(runs_dir: str | Path) -> Path:
    """Return the folder of solutions within a folder of runs."""
    return Path(runs_dir) / LIMITS


@dataclass(frozen=True, eq=False)
class Solution:
    """A flight of a race at discrete nodes; the control is constant between nodes."""

    # "rotors" or "rates", see quadsim.limit.dynamics
    model: ModelName
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
        """Return positions (n, 3) at times t (n,), by cubics with the nodes' velocities."""
        # Here, as reports load this module and scipy takes .3 s
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self.t, self.x[:, POSITION], self.x[:, VELOCITY])(t)


@dataclass(frozen=True, eq=False)
class StoredSolution:
    """The best solution known of a race, with the findings of its check."""

    # Names of course and vehicle
    course: str
    vehicle: str
    laps: int
    closed: bool
    # Lap times by the referee [s]
    lap_times: tuple[float, ...]
    verified: Check
    solution: Solution
    # Margin and reserve as in LimitProblem
    margin: float = 0.0
    reserve: float = 0.0
    # The problem's key
    key: str = ""
    # The sha256 of its file's content, hexadecimal; "" before it is read from a file
    digest: str = ""

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

        Between nodes the position is interpolated by cubics, and everything else linearly.
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
        # The states that the model has beside the rigid body's
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
        """Return the share by which a race time [s] exceeds this solution's time."""
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
        """Return the problem of a race from a standing start, with rotors if there are any."""
        return cls(course, vehicle, laps, "rotors" if vehicle.rotors else "rates")

    @classmethod
    def of_run(cls, spec: dict) -> LimitProblem | None:
        """Return the problem of a run's race, None if no limit applies to it.

        No limit applies to a plant of another simulator, to a user's own plant or referee, or to
        the timed mode.
        """
        own = {"plant", "referee"} & set(spec.get("own", {}))
        if own or spec.get("plant") in ("rotorpy", "crazyflow") or spec.get("penalties"):
            return None
        course = parse_course(spec["course"]["text"], spec["course"]["name"])
        return cls.of(course, msgspec.convert(spec["vehicle"], Vehicle), spec["laps"])

    @cached_property
    def key(self) -> str:
        """The sha256 of the numbers that decide the limit [16 hex digits]."""
        text = json.dumps(_rounded(self._numbers()), sort_keys=True)
        return sha256(text.encode()).hexdigest()[:16]

    def _numbers(self) -> dict[str, Any]:
        """Return the numbers that the search and its check read.

        Names, latency, sensors and uncertainties of a vehicle do not change the limit.
        """
        course = self.course
        return {
            "laps": self.laps,
            "model": self.model,
            "closed": self.closed,
            "margin": self.margin,
            "reserve": self.reserve,
            "start": (*course.start.position, course.start.yaw),
            "bounds": course.bounds,
            "gates": [_gate_numbers(gate) for gate in course.gates],
            "obstacles": [_obstacle_numbers(obstacle) for obstacle in course.obstacles],
            "vehicle": _vehicle_numbers(self.vehicle),
        }

    @property
    def file_name(self) -> str:
        """The name of the solution's file, which ends with the key."""
        parts = [self.course.name, self.vehicle.name, str(self.laps)]
        if self.closed:
            parts.append("closed")
        parts.append(self.model)
        if self.margin or self.reserve:
            parts += [f"margin{self.margin:g}", f"reserve{self.reserve:g}"]
        readable = re.sub(r"[^A-Za-z0-9_.-]", "-", "_".join(parts))
        return f"{readable}_{self.key}.npz"

    def best_known(self, *folders: Path) -> StoredSolution | None:
        """Return the fastest solution in these folders or of the project, None if there is none.

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
            stored = load(path)
        except LimitError as error:
            raise LimitError(f"{error}: {ADVICE}") from None
        if stored.key != self.key:
            other = f"the race of {shown(stored.course)} with {shown(stored.vehicle)}"
            wanted = f"expected {WHAT} with the key {self.key}"
            raise LimitError(f"{path}: {wanted}, got {stored.key}, {other}: {ADVICE}")
        return stored


def _gate_numbers(gate: Gate) -> tuple[float, ...]:
    """Return the numbers of a gate on which the least time depends [m], [rad]."""
    angles = (gate.yaw, gate.pitch, gate.roll)
    return (*gate.position, *angles, *gate.opening, gate.frame_width, gate.frame_depth)


def _obstacle_numbers(obstacle: Obstacle) -> tuple[float, ...]:
    """Return the numbers of an obstacle, five for a cylinder and seven for a box [m], [rad]."""
    if isinstance(obstacle, Cylinder):
        return (*obstacle.base, obstacle.radius, obstacle.height)
    return (*obstacle.centre, *obstacle.size, obstacle.yaw)


def _vehicle_numbers(vehicle: Vehicle) -> dict[str, Any]:
    """Return a vehicle's numbers on which the least time depends, in their usual units."""
    numbers: dict[str, Any] = {
        "mass": vehicle.mass,
        "inertia": vehicle.inertia,
        "radius": vehicle.radius,
        "rate_tau": vehicle.rate_tau,
        "rate_lead": vehicle.rate_lead,
        "rate_max": vehicle.omega_max,
        "thrust_max": vehicle.thrust_max,
        "drag": vehicle.drag,
    }
    rotors = vehicle.rotors
    if rotors is None:
        return numbers
    return numbers | {
        "rotors": rotors.positions,
        "spin": rotors.spin,
        "thrust_map": rotors.thrust_map,
        "omega": (rotors.motor_omega_min, rotors.motor_omega_max),
        "motor_tau": rotors.motor_tau,
        "kappa": rotors.kappa,
    }


def _rounded(value: Any) -> Any:
    """Return a value with all numbers rounded to 9 digits, so that the last bits do not matter."""
    match value:
        case dict():
            return {key: _rounded(inner) for key, inner in value.items()}
        case list() | tuple():
            return [_rounded(inner) for inner in value]
        case str() | bool():
            return value
    return float(f"{value:.9g}")


def _fastest(found: Iterator[StoredSolution]) -> StoredSolution | None:
    """Return the fastest solution, the first if several are equal, None if there is none."""
    return min(found, key=lambda stored: stored.time, default=None)


def ignore(_: str) -> None:
    """Ignore a remark."""


def limit_of(
    spec: dict, *folders: Path, remark: Callable[[str], object] = ignore
) -> StoredSolution | None:
    """Return the best solution known of a run's race, None if there is none.

    Damaged files are skipped, and a spec that does not describe a race has no solution.

    Args:
        spec: the spec of the run.
        folders: folders to search besides the project's own; see `limits_folder`.
        remark: function that is called with a line for each file that cannot be read.
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
    """Yield the readable solutions of a race, and call `remark` for each unreadable file."""
    for path in problem.files(*folders):
        try:
            yield problem.read(path)
        except LimitError as error:
            remark(str(error))


def dump(stored: StoredSolution) -> bytes:
    """Return the content of a solution's file."""
    solution = stored.solution
    facts = Facts(
        key=stored.key,
        course=stored.course,
        vehicle=stored.vehicle,
        laps=stored.laps,
        closed=stored.closed,
        model=solution.model,
        margin=stored.margin,
        reserve=stored.reserve,
        lap_times=stored.lap_times,
        verified=stored.verified,
    )
    arrays = {FACTS: np.array(msgspec.json.encode(facts).decode())}
    for name, declared in NODES.items():
        arrays[name] = getattr(solution, name).astype(declared.dtype)
    return npz_bytes(arrays | {HASH: np.array(_hash(arrays))}, compressed=True)


def load(path: Path) -> StoredSolution:
    """Read a solution's file.

    Raises:
        LimitError: the file is damaged, has another format, or is not a solution.
    """
    try:
        data = read_bytes(path, WHAT, LARGEST)
        arrays = arrays_of(data, ARRAYS, path, WHAT, LARGEST)
        expect_format(arrays[FACTS], FORMAT, path, WHAT)
        stated = arrays.pop(HASH, np.array(""))
        digest = _hash(arrays)
        if stated.item() != digest:
            raise LimitError(f"{path}: expected {WHAT}, got one whose content has changed")
        facts = record_of(arrays[FACTS], Facts, path, WHAT)
    except LimitError:
        raise
    except FileError as error:
        raise LimitError(str(error)) from None
    doubles = {name: arrays[name].astype(float) for name in ("t", "x", "u", "costate")}
    return StoredSolution(
        course=facts.course,
        vehicle=facts.vehicle,
        laps=facts.laps,
        closed=facts.closed,
        lap_times=facts.lap_times,
        verified=facts.verified,
        solution=Solution(facts.model, target=arrays["target"].astype(int), **doubles),
        margin=facts.margin,
        reserve=facts.reserve,
        key=facts.key,
        digest=digest,
    )


def _hash(arrays: Mapping[str, np.ndarray]) -> str:
    """Return the sha256 [hex] of a file's arrays, except the array that holds it."""
    found = sha256(arrays[FACTS].item().encode())
    for name in NODES:
        found.update(np.ascontiguousarray(arrays[name]).tobytes())
    return found.hexdigest()
