"""The task of an environment: courses, vehicle, rewards and starts.

`tables` turns a task into the arrays that the compiled lanes read.
"""

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
from quadsim.dynamics import System
from quadsim.dynamics.quadrotor import ModelParams, quadrotor
from quadsim.learn.reward import RewardWeights
from quadsim.learn.starts import start_rows
from quadsim.race.referee import check
from quadsim.spec.settings import SettingError
from quadsim.spec.spec import default_timeout
from quadsim.streams import start_stream
from quadsim.vehicle import Vehicle, load_vehicle

STARTS = ("standing", "anywhere")
# name of a setting -> its lowest and its highest value
RANGES = {
    "dt": (1e-3, 0.05),
    "randomize": (0.0, 3.0),
    "time_limit": (0.1, 1e4),
    "noise": (0.0, 10.0),
}


@dataclass(frozen=True)
class LearningTask:
    """A race to be learnt. The function `task` makes one from names and checks its values."""

    courses: tuple[Course, ...]
    vehicle: Vehicle
    laps: tuple[int, ...]  # one number for each course
    dt: float = 0.01  # duration of an environment's step [s]
    start: str = "standing"  # one of STARTS
    # scale of the randomization of start and vehicle, see quadsim.physics.domain_randomization
    randomize: float = 0.0
    time_limit: float = 60.0  # longest duration of an episode [s]
    noise: float = 0.0  # standard deviation of each number observed, in its unit
    rewards: RewardWeights = field(default_factory=RewardWeights)

    @property
    def system(self) -> System:
        """The model of the nominal vehicle."""
        return quadrotor(ModelParams.of(self.vehicle), self.dt)

    def cost(self, k: int) -> Cost:
        """Return the racing cost of course k.

        An environment uses the progress and the gate tests of this cost, not its weights: an
        environment's weights are those of the reward.
        """
        weights = RaceWeights(margin=self.rewards.margin)
        return race_cost(self.courses[k], self.vehicle.radius, weights, self.laps[k])


@dataclass(frozen=True)
class Tables:
    """Arrays over all courses, float32 unless stated otherwise; shorter courses are padded."""

    targets: np.ndarray  # (courses, rows, n_row)
    final_row: np.ndarray  # (courses,) int32: the row at which a race is finished
    p_cost: np.ndarray  # (courses, n_q)
    obstacles: np.ndarray  # (courses, obstacles, n_obstacle)
    n_obstacles: np.ndarray  # (courses,) int32
    starts: np.ndarray  # (courses, starts, ...)


def tables(task: LearningTask, seed: int) -> Tables:
    """Return the arrays of a task's courses, with starts drawn from the seed."""
    costs: list[Cost] = []
    rows: list[np.ndarray] = []
    obstacles: list[np.ndarray] = []
    starts: list[np.ndarray] = []
    for k, course in enumerate(task.courses):
        cost = task.cost(k)
        costs.append(cost)
        rows.append(np.hstack([cost.targets, gate_rows(course, task.laps[k])]))
        if cost.obstacles:
            obstacles.append(cost.obstacles.rows)
        course_starts = start_rows(
            course,
            cost,
            task.vehicle,
            task.dt,
            task.start,
            task.randomize,
            seeds=start_stream(seed, k),
        )
        starts.append(course_starts)
    return Tables(
        targets=_padded(rows),
        final_row=np.array([len(r) - 1 for r in rows], np.int32),
        p_cost=np.array([cost.params for cost in costs], np.float32),
        obstacles=_padded(obstacles),
        n_obstacles=np.array([len(o) for o in obstacles], np.int32),
        starts=np.array(starts, np.float32),
    )


def _padded(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Return the arrays stacked, each padded with its last row.  (n, most rows, columns) float32"""
    most = max(map(len, arrays))
    padded = [np.pad(a, ((0, most - len(a)), (0, 0)), mode="edge") for a in arrays]
    return np.array(padded, np.float32)


def task(
    course: Any = "split_s_swift",
    vehicle: Any = "swift",
    laps: int | None = None,
    reward: Any = None,
    **settings: Any,
) -> LearningTask:
    """Return a task, with the courses and the vehicle of these names.

    Args:
        course: a name, a FILE.yaml, a Course, or a list of these.
        vehicle: a name, a FILE.yaml or a Vehicle.
        laps: number of laps of every course; None: each course's own.
        reward: RewardWeights, or {term: weight} for the terms that differ from the defaults.
        settings: dt [s], start, randomize, time_limit [s], noise.

    Raises:
        SettingError: a value is invalid; its message is one line (a ValueError).
        FileError: a course or a vehicle cannot be read.
    """
    given = course if isinstance(course, list | tuple) else [course]
    courses = tuple(_course(one) for one in given)
    if not courses:
        raise SettingError("course", "expected at least one, got none")
    if not isinstance(vehicle, Vehicle):
        vehicle = load_vehicle(_path("vehicle", vehicle))
    if laps is None:
        laps_of_each = tuple(course.laps for course in courses)
    else:
        laps_of_each = (_count("laps", laps),) * len(courses)
    _check_settings(settings)
    for one, count in zip(courses, laps_of_each, strict=True):
        check(one, count, SweptGates(one.gates, vehicle.radius).all, vehicle.radius)
    if settings.get("time_limit") is None:
        longest = max(default_timeout(c, n) for c, n in zip(courses, laps_of_each, strict=True))
        settings["time_limit"] = longest
    return LearningTask(courses, vehicle, laps_of_each, rewards=_weights(reward), **settings)


def _course(given: Any) -> Course:
    return given if isinstance(given, Course) else load_course(_path("course", given))


def _check_settings(settings: Mapping[str, Any]) -> None:
    """Raise SettingError unless all settings are known and within their ranges."""
    for name, value in settings.items():
        if name == "start":
            if value not in STARTS:
                wanted = f"expected one of {', '.join(STARTS)}"
                raise SettingError("start", f"{wanted}, got {value!r}")
        elif name not in RANGES:
            names = ", ".join(("course", "vehicle", "laps", "reward", "start", *RANGES))
            problem = f"no such setting of an environment, known are {names}"
            raise SettingError(name, problem)
        elif value is not None:
            low, high = RANGES[name]
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if not is_number or not low <= value <= high:
                raise SettingError(name, f"expected a number in {low:g} .. {high:g}, got {value!r}")


def _weights(given: Any) -> RewardWeights:
    """Return the reward's weights from what the user gave. Raises SettingError."""
    if given is None:
        return RewardWeights()
    if isinstance(given, RewardWeights):
        return given
    names = [f.name for f in fields(RewardWeights)]
    if not isinstance(given, Mapping) or not set(given) <= set(names):
        wanted = f"expected RewardWeights or weights of {', '.join(names)}"
        raise SettingError("reward", f"{wanted}, got {given!r}")
    return RewardWeights(**given)


def _count(name: str, given: Any) -> int:
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise SettingError(name, f"expected a whole number of at least 1, got {given!r}")
    return given


def _path(name: str, given: Any) -> str | Path:
    if not isinstance(given, str | Path):
        wanted = "expected a name, a FILE.yaml or an object of this kind"
        raise SettingError(name, f"{wanted}, got {given!r}")
    return given
