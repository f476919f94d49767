"""Solutions: a race by its nodes; kept as npz, looked up by course, vehicle and laps."""

from __future__ import annotations

import json
import re
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from quadsim.course import Course, parse_course
from quadsim.dynamics.quadrotor import BODY_RATES, POSITION, RIGID_BODY, VELOCITY, Control, State
from quadsim.files.arrays import TEXT, Declared, npz_bytes, read_arrays, record_of
from quadsim.files.strict_yaml import FileError
from quadsim.vehicle import Vehicle

SOLUTIONS = Path(__file__).parent / "solutions"  # those that come with the project
LIMITS = "limits"  # folder among the runs, for those that are found here
WHAT = "the solution of a race"
ARRAYS = {
    "facts": TEXT,
    "t": Declared("float64", ("nodes",), finite=True),
    "x": Declared("float32", ("nodes", "states"), finite=True),
    "u": Declared("float32", ("intervals", "controls"), finite=True),
    "costate": Declared("float32", ("intervals", "states"), finite=True),
    "target": Declared("int16", ("intervals",)),
}
FACTS = ("course", "vehicle", "laps", "closed", "lap_times", "verified", "margin", "reserve")
# of a course or a vehicle: what changes no race
NAMES = ("name", "source", "text", "published", "laps", "loop")


class LimitError(FileError):
    """A solution that cannot be read. One line: the file, what is wrong."""


@dataclass(frozen=True, eq=False)
class Solution:
    """A race by its nodes; from one to the next the control is constant."""

    model: str  # rotors, rates
    t: np.ndarray  # (nodes,) [s]
    x: np.ndarray  # (nodes, n_x) states of the model
    u: np.ndarray  # (nodes - 1, n_u)
    # (nodes - 1, n_x) how the time that is left changes with the state after the interval [s]
    costate: np.ndarray
    target: np.ndarray  # (nodes - 1,) index of the target that the interval leads to, from 0

    @property
    def time(self) -> float:
        """[s]"""
        return float(self.t[-1])

    def position(self, t: np.ndarray) -> np.ndarray:
        """Cubic between the nodes, as they have velocities.  t (n,) [s] -> (n, 3) [m]"""
        # here: reports load this module, scipy takes .3 s
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self.t, self.x[:, POSITION], self.x[:, VELOCITY])(t)


@dataclass(frozen=True, eq=False)
class Limit:
    """The best solution known of a race, and what its check has found."""

    course: str
    vehicle: str
    laps: int
    closed: bool
    lap_times: list[float]  # [s]
    verified: dict
    solution: Solution
    margin: float = 0.0  # as of the Race
    reserve: float = 0.0

    @property
    def time(self) -> float:
        """Of the race, by the referee [s]."""
        return sum(self.lap_times)

    def path(self, rate: float = 100.0) -> np.ndarray:
        """Time [s] and position [m] so many times a second.  (n, 4)"""
        t = self.solution.t
        times = np.append(np.arange(0.0, t[-1] - 0.5 / rate, 1.0 / rate), t[-1])
        return np.column_stack([times, self.solution.position(times)])

    def states(self, vehicle: Vehicle, t: np.ndarray) -> np.ndarray:
        """STATE, linear between the nodes but for the position.  t (n,) -> (n, 17)"""
        s, rotors = self.solution, vehicle.rotors
        u = np.vstack([s.u, s.u[-1:]])
        body = s.x[:, RIGID_BODY]
        more = s.x[:, RIGID_BODY.stop :]  # what the model has beside the rigid body
        if s.model == "rotors" and rotors:
            thrusts = rotors.thrust(more) if rotors.tau > 0.0 else u  # pyright: ignore[reportArgumentType]
            thrust = np.sum(thrusts, axis=1) / vehicle.mass
        elif more.shape[1]:  # thrust and angular acceleration
            thrust = State(*s.x.T).thrust
        else:
            thrust = Control(*u.T).thrust
        spin = np.gradient(s.x[:, BODY_RATES], s.t, axis=0)
        whole = np.column_stack([body, thrust, spin])
        x = np.column_stack([np.interp(t, s.t, column) for column in whole.T])
        x[:, POSITION] = s.position(t)
        return x

    def above(self, time: float) -> float:
        """By how much a race's time [s] exceeds it, as a share."""
        return time / self.time - 1.0


@dataclass(frozen=True)
class Race:
    """What a limit is the limit of."""

    course: Course
    vehicle: Vehicle
    laps: int
    model: str  # rotors, rates
    closed: bool = False  # one lap that ends as it begins
    margin: float = 0.0  # of a path to be flown: kept to the frames within openings [m]
    reserve: float = 0.0  # and the share of the thrust that is left unused

    @classmethod
    def of(cls, course: Course, vehicle: Vehicle, laps: int) -> Race:
        """From a standing start, with the model by which the vehicle flies in the plant."""
        return cls(course, vehicle, laps, "rotors" if vehicle.rotors else "rates")

    @classmethod
    def of_run(cls, spec: dict) -> Race | None:
        """The race that a run's spec says; None for another system, for a plant with dynamics of
        its own or other parts of a user's own, and for the timed mode."""
        own = {"plant", "referee", "system"} & set(spec.get("own", {})) or spec.get(
            "plant"
        ) == "rotorpy"
        if spec.get("system", "quadrotor") != "quadrotor" or own or spec.get("penalties"):
            return None
        course = parse_course(spec["course_text"], spec["course"])
        return cls.of(course, msgspec.convert(spec["vehicle"], Vehicle), spec["laps"])

    @cached_property
    def key(self) -> str:
        """sha256 [16 hex digits] of all that decides the limit."""
        whole = {k: v for k, v in asdict(self).items() if k not in ("margin", "reserve") or v}
        for part in ("course", "vehicle"):
            whole[part] = {
                k: v for k, v in whole[part].items() if k not in NAMES and (k != "obstacles" or v)
            }
        return sha256(json.dumps(_rounded(whole), sort_keys=True).encode()).hexdigest()[:16]

    @property
    def file_name(self) -> str:
        parts = (
            self.course.name,
            self.vehicle.name,
            str(self.laps),
            *(["closed"] if self.closed else []),
            self.model,
        )
        parts += (
            (f"margin{self.margin:g}", f"reserve{self.reserve:g}")
            if self.margin or self.reserve
            else ()
        )
        return f"{re.sub(r'[^A-Za-z0-9_.-]', '-', '_'.join(parts))}_{self.key}.npz"

    def best_known(self, *folders: Path) -> Limit | None:
        """The fastest solution that lies here or comes with the project. Raises LimitError."""
        paths = (
            path
            for folder in (SOLUTIONS, *folders)
            for path in sorted(folder.glob(f"*_{self.key}.npz"))
        )
        return min(map(load, paths), key=lambda limit: limit.time, default=None)


def limit_of(spec: dict, *folders: Path) -> Limit | None:
    """The best known limit of the race that a run's spec says; None too where that or the limit's
    file is damaged.

    folders: where else than in the project to look.
    """
    with suppress(FileError, KeyError, msgspec.ValidationError):
        race = Race.of_run(spec)
        return race.best_known(*folders) if race else None


def dump(limit: Limit) -> bytes:
    """Return the content of a solution's file.

    States are in single precision, whose rounding the check allows for.
    """
    facts = {name: getattr(limit, name) for name in FACTS} | {"model": limit.solution.model}
    arrays = {"facts": np.array(json.dumps(facts))}
    for name, declared in ARRAYS.items():
        if name != "facts":
            arrays[name] = getattr(limit.solution, name).astype(declared.dtype)
    return npz_bytes(arrays, compressed=True)


def load(path: Path) -> Limit:
    """Return the limit in a solution's file. Raises LimitError."""
    try:
        arrays = read_arrays(path, ARRAYS, WHAT)
        facts = record_of(arrays.pop("facts"), path, WHAT)
    except FileError as error:
        raise LimitError(str(error)) from None
    target = arrays.pop("target").astype(int)
    doubles = {name: array.astype(float) for name, array in arrays.items()}
    try:
        solution = Solution(facts.pop("model"), target=target, **doubles)
        limit = Limit(**facts, solution=solution)
        _check_nodes(limit.solution)
    except (KeyError, TypeError, ValueError) as error:
        raise LimitError(f"{path}: expected {WHAT}: {error}") from None
    return limit


def _check_nodes(solution: Solution) -> None:
    """Raise ValueError unless intervals lie between the nodes and times rise."""
    intervals = len(solution.t) - 1
    if intervals < 1 or len(solution.u) != intervals:
        raise ValueError("its arrays are not of one length")
    if not (np.diff(solution.t) > 0.0).all():
        raise ValueError("expected rising times")


def _rounded(value: Any) -> Any:
    """To 9 digits: the last bits of an angle in radians are no other course."""
    match value:
        case dict():
            return {k: _rounded(v) for k, v in value.items()}
        case list() | tuple():
            return [_rounded(v) for v in value]
        case float() | int() if not isinstance(value, bool):
            return float(f"{value:.9g}")
    return value
