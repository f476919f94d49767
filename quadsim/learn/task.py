"""What is flown in an environment: courses, vehicle, rewards and starts, and the tables of numbers
that lanes read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from controllers.costs import Cost
from controllers.costs.race import RaceWeights, race_cost
from controllers.learned.observation import gate_rows
from quadsim.course import Course, load_course
from quadsim.course.swept import SweptGates
from quadsim.dynamics.quadrotor import ModelParams, quadrotor
from quadsim.learn.reward import RewardWeights
from quadsim.learn.starts import start_rows
from quadsim.race.referee import check
from quadsim.spec.settings import SettingError
from quadsim.spec.systems import SYSTEMS
from quadsim.streams import start_stream
from quadsim.vehicle import Vehicle, load_vehicle

STARTS = ("standing", "anywhere")


@dataclass(frozen=True)
class Task:
    """A race to be learnt. Build with `task`, which resolves names and checks."""

    courses: tuple[Course, ...]
    vehicle: Vehicle
    laps: tuple[int, ...]  # of each course
    dt: float = 0.01  # of an environment's step [s]
    start: str = "standing"  # of STARTS
    # size of domain randomization: start and vehicle, see quadsim.physics.domain_randomization
    randomize: float = 0.0
    time_limit: float = 60.0  # of an episode [s]
    noise: float = 0.0  # standard deviation of each number observed, in its unit
    rewards: RewardWeights = field(default_factory=RewardWeights)

    @property
    def system(self) -> Any:
        return quadrotor(ModelParams.of(self.vehicle), self.dt)

    def cost(self, k: int) -> Cost:
        """Return the racing cost of course k, which measures progress and tests the gates; the
        reward weighs it."""
        weights = RaceWeights(margin=self.rewards.margin)
        return race_cost(self.courses[k], self.vehicle.radius, weights, self.laps[k])


@dataclass(frozen=True)
class Tables:
    """The numbers of each course, padded to the largest, float32."""

    targets: np.ndarray  # (courses, rows, n_row)
    final_row: np.ndarray  # (courses,) int32: the row at which a race is finished
    p_cost: np.ndarray  # (courses, n_q)
    obstacles: np.ndarray  # (courses, obstacles, n_obstacle)
    n_obstacles: np.ndarray  # (courses,) int32
    starts: np.ndarray  # (courses, starts, ...)


def tables(task: Task, seed: int) -> Tables:
    """Starts are drawn from the seed."""
    costs = [task.cost(k) for k in range(len(task.courses))]
    rows = [
        np.hstack([cost.targets, gate_rows(course, laps)])
        for cost, course, laps in zip(costs, task.courses, task.laps, strict=True)
    ]
    obstacles = [cost.obstacles.rows for cost in costs if cost.obstacles]
    starts = [
        start_rows(
            course, cost, task.vehicle, task.dt, task.start, task.randomize, start_stream(seed, k)
        )
        for k, (course, cost) in enumerate(zip(task.courses, costs, strict=True))
    ]
    return Tables(
        targets=_padded(rows),
        final_row=np.array([len(r) - 1 for r in rows], np.int32),
        p_cost=np.array([cost.params for cost in costs], np.float32),
        obstacles=_padded(obstacles),
        n_obstacles=np.array([len(o) for o in obstacles], np.int32),
        starts=np.array(starts, np.float32),
    )


def _padded(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """One array of them all, the last row repeated.  (n, most rows, columns) float32"""
    most = max(map(len, arrays))
    return np.array(
        [np.pad(a, ((0, most - len(a)), (0, 0)), mode="edge") for a in arrays], np.float32
    )


def task(
    course: Any = "split_s_swift",
    vehicle: Any = "swift",
    laps: int | None = None,
    reward: Any = None,
    **more: Any,
) -> Task:
    """A Task; names of courses and vehicles are looked up.

    Args:
        course: a name, a FILE.yaml, a Course, or a list of these.
        vehicle: a name, a FILE.yaml or a Vehicle.
        laps: of every course; None: its own.
        reward: RewardWeights, or {term: weight} that differ from its own.
        more: dt [s], start, randomize, time_limit [s], noise.

    Raises:
        SettingError: a value that does not fit, a ValueError of one line.
        FileError: a course or vehicle that cannot be read.
    """
    several = course if isinstance(course, list | tuple) else [course]
    courses = tuple(
        c if isinstance(c, Course) else load_course(_path("course", c)) for c in several
    )
    if not courses:
        raise SettingError("course", "expected at least one, got none")
    flown = vehicle if isinstance(vehicle, Vehicle) else load_vehicle(_path("vehicle", vehicle))
    of_each = tuple(_count("laps", laps) if laps is not None else c.laps for c in courses)
    _check(more)
    for c, n in zip(courses, of_each, strict=True):
        check(c, n, SweptGates(c.gates, flown.radius).all, flown.radius)
    if more.get("time_limit") is None:
        more["time_limit"] = max(
            SYSTEMS["quadrotor"].timeout(c, n) for c, n in zip(courses, of_each, strict=True)
        )
    return Task(courses, flown, of_each, rewards=_weights(reward), **more)


def _check(more: dict[str, Any]) -> None:
    """Raises SettingError."""
    known = {
        "dt": (1e-3, 0.05),
        "randomize": (0.0, 3.0),
        "time_limit": (0.1, 1e4),
        "noise": (0.0, 10.0),
    }
    for name, value in more.items():
        if name == "start":
            if value not in STARTS:
                raise SettingError("start", f"expected one of {', '.join(STARTS)}, got {value!r}")
        elif name not in known:
            names = ", ".join(("course", "vehicle", "laps", "reward", "start", *known))
            raise SettingError(name, f"no such setting of an environment, known are {names}")
        elif value is not None:
            low, high = known[name]
            if (
                isinstance(value, bool)
                or not isinstance(value, int | float)
                or not low <= value <= high
            ):
                raise SettingError(name, f"expected a number in {low:g} .. {high:g}, got {value!r}")


def _weights(given: Any) -> RewardWeights:
    if given is None or isinstance(given, RewardWeights):
        return given or RewardWeights()
    names = [f.name for f in fields(RewardWeights)]
    if not isinstance(given, Mapping) or not set(given) <= set(names):
        raise SettingError(
            "reward", f"expected RewardWeights or weights of {', '.join(names)}, got {given!r}"
        )
    return RewardWeights(**given)


def _count(name: str, given: Any) -> int:
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise SettingError(name, f"expected a whole number of at least 1, got {given!r}")
    return given


def _path(name: str, given: Any) -> str | Path:
    if not isinstance(given, str | Path):
        raise SettingError(
            name, f"expected a name, a FILE.yaml or an object of this kind, got {given!r}"
        )
    return given
