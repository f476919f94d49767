"""The task of an environment: courses, vehicle, rewards and starts.

`tables` turns a task into the arrays that the compiled lanes read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import numpy as np
from msgspec import inspect

from quadsim.config.resolve import default_timeout
from quadsim.config.settings import LapCount
from quadsim.controllers.costs import Cost
from quadsim.controllers.costs.race import RaceWeights, race_cost
from quadsim.controllers.learned.observation import gate_rows
from quadsim.course import Course, load_course
from quadsim.course.swept import SweptGates
from quadsim.dynamics import System
from quadsim.dynamics.quadrotor import ModelParams, quadrotor
from quadsim.files.strict_yaml import setting
from quadsim.files.values import SettingError, check_fields, checked_object, kinds_of
from quadsim.files.yaml_errors import shown_value
from quadsim.learn.reward import RewardWeights
from quadsim.learn.starts import start_rows
from quadsim.racing.referee import check
from quadsim.streams import start_stream
from quadsim.vehicle import Vehicle, load_vehicle

Start = Literal["standing", "anywhere"]
LAPS = inspect.type_info(LapCount)


@dataclass(frozen=True)
class LearningTask:
    """The task of a race of one vehicle; the function `task` makes one from names.

    Raises:
        SettingError: a number has a wrong type or is out of range (a ValueError).
    """

    courses: tuple[Course, ...]
    vehicle: Vehicle
    laps: tuple[int, ...]  # one number for each course
    dt: Annotated[
        float, setting("duration of an environment's step", unit="s", ge=1e-3, le=0.05)
    ] = 0.01
    start: Annotated[
        Start, setting("initial states of episodes: the race's start, or anywhere on the course")
    ] = "standing"
    # see quadsim.physics.domain_randomization
    randomize: Annotated[
        float, setting("scale of the randomization of start and vehicle", ge=0, le=3)
    ] = 0.0
    time_limit: Annotated[
        float, setting("longest duration of an episode", unit="s", ge=0.1, le=1e5)
    ] = 60.0
    noise: Annotated[
        float, setting("standard deviation of each observed number, in its unit", ge=0, le=10)
    ] = 0.0
    rewards: RewardWeights = field(default_factory=RewardWeights)

    # Vehicles that race together. A task of one has no setting for it; RaceTask has.
    racers = 1

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def system(self) -> System:
        """The model of the nominal vehicle."""
        return quadrotor(ModelParams.of(self.vehicle), self.dt)

    def cost(self, k: int) -> Cost:
        """Return the racing cost of course k.

        An environment uses the cost's progress and gate tests, and weights them by the reward.
        """
        weights = RaceWeights(margin=self.rewards.margin)
        return race_cost(self.courses[k], self.vehicle.radius, weights, self.laps[k])


Task = TypeVar("Task", bound=LearningTask)


@dataclass(frozen=True)
class Tables:
    """Arrays over all courses, float32 unless stated otherwise; shorter courses are padded."""

    targets: np.ndarray  # (courses, rows, n_row)
    final_row: np.ndarray  # (courses,) int32: the row at which a race is finished
    p_cost: np.ndarray  # (courses, n_q)
    obstacles: np.ndarray  # (courses, obstacles, n_obstacle)
    n_obstacles: np.ndarray  # (courses,) int32
    starts: np.ndarray  # (courses, starts, ...)


class CourseTables(NamedTuple):
    """The arrays of one course."""

    course: Course
    laps: int
    cost: Cost
    starts: np.ndarray  # (starts, ...)


def tables(task: LearningTask, seed: int) -> Tables:
    """Return the arrays of a task's courses, with random starts from the seed.

    Each course is repeated for each racer, because every racer has its own starts: racer a on
    course k has row k * racers + a.
    """
    rows: list[CourseTables] = []
    for k, course in enumerate(task.courses):
        cost = task.cost(k)
        starts = start_rows(
            course,
            cost,
            task.vehicle,
            task.dt,
            task.start,
            task.randomize,
            seeds=start_stream(seed, k),
            racers=task.racers,
        )
        for a in range(task.racers):
            rows.append(CourseTables(course, task.laps[k], cost, starts[a]))
    return stacked(rows)


def stacked(courses: Sequence[CourseTables]) -> Tables:
    """Return the arrays of all courses, a row for each."""
    rows = [np.hstack([c.cost.targets, gate_rows(c.course, c.laps)]) for c in courses]
    obstacles = [c.cost.obstacles.rows for c in courses if c.cost.obstacles]
    return Tables(
        targets=_padded(rows),
        final_row=np.array([len(r) - 1 for r in rows], np.int32),
        p_cost=np.array([c.cost.params for c in courses], np.float32),
        obstacles=_padded(obstacles),
        n_obstacles=np.array([len(o) for o in obstacles], np.int32),
        starts=np.array([c.starts for c in courses], np.float32),
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
    """Return a task, with courses and vehicle given by names.

    Args:
        course: a name, a FILE.yaml, a Course, or a list of these.
        vehicle: a name, a FILE.yaml or a Vehicle.
        laps: number of laps on every course; None: each course's number.
        reward: RewardWeights, or {term: weight} for the terms that differ from the defaults.
        settings: dt [s], start, randomize, time_limit [s] and noise; None stands for the default.

    Raises:
        SettingError: a value is invalid; its message is one line (a ValueError).
        FileError: a course or a vehicle cannot be read.
    """
    return make_task(LearningTask, RewardWeights, course, vehicle, laps, reward, settings)


def make_task(
    kind: type[Task],
    weights: type[RewardWeights],
    course: Any,
    vehicle: Any,
    laps: int | None,
    reward: Any,
    settings: Mapping[str, Any],
) -> Task:
    """Return a task of this kind, see `task`.

    Args:
        kind: the task's dataclass.
        weights: the dataclass of its rewards.
        course, vehicle, laps, reward: see `task`.
        settings: further fields of the task.
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
        laps_of_each = (checked_object("laps", laps, LAPS),) * len(courses)
    chosen = _checked_settings(settings, kind)
    rewards = _weights(reward, weights)
    for one, count in zip(courses, laps_of_each, strict=True):
        check(one, count, SweptGates(one.gates, vehicle.radius).all, vehicle.radius)
    if "time_limit" not in chosen:
        longest = max(default_timeout(c, n) for c, n in zip(courses, laps_of_each, strict=True))
        chosen["time_limit"] = longest
    return kind(courses, vehicle, laps_of_each, rewards=rewards, **chosen)


def _course(given: Any) -> Course:
    return given if isinstance(given, Course) else load_course(_path("course", given))


def _checked_settings(settings: Mapping[str, Any], kind: type[LearningTask]) -> dict[str, Any]:
    """Return the settings that are not None.

    Raises:
        SettingError: a setting is unknown or out of range.
    """
    kinds = kinds_of(kind)
    for name in settings:
        if name not in kinds:
            names = ", ".join(("course", "vehicle", "laps", "reward", *kinds))
            problem = f"no such setting of an environment, known are {names}"
            raise SettingError(name, problem)
    given = {name: value for name, value in settings.items() if value is not None}
    return {name: checked_object(name, value, kinds[name]) for name, value in given.items()}


def _weights(given: Any, kind: type[RewardWeights]) -> RewardWeights:
    """Return the reward's weights from the user's value. Raises SettingError."""
    if given is None:
        return kind()
    if isinstance(given, kind):
        return given
    names = [f.name for f in fields(kind)]
    if not isinstance(given, Mapping) or not set(given) <= set(names):
        wanted = f"expected {kind.__name__} or weights of {', '.join(names)}"
        raise SettingError("reward", f"{wanted}, got {shown_value(given)}")
    try:
        return kind(**given)
    except SettingError as error:
        raise SettingError(f"reward.{error.name}", error.problem) from None


def _path(name: str, given: Any) -> str | Path:
    if not isinstance(given, str | Path):
        wanted = "expected a name, a FILE.yaml or an object of this kind"
        raise SettingError(name, f"{wanted}, got {shown_value(given)}")
    return given
