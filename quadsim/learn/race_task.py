"""The task of a race of several vehicles: a LearningTask with racers, collisions and ranks.

    r_race = r + rank (places gained) - crash (collided)

where r is the reward of a single vehicle (quadsim.learn.reward).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

from numpy import maximum, minimum

from quadsim.files.strict_yaml import setting
from quadsim.files.values import SettingError
from quadsim.learn.reward import MOST, RewardWeights
from quadsim.learn.starts import start_fault
from quadsim.learn.task import LearningTask, make_task


class RaceRewardParams(NamedTuple):
    """The weights of `race_reward`, named as in RaceRewardWeights."""

    rank: float
    crash: float


@dataclass(frozen=True)
class RaceRewardWeights(RewardWeights):
    """Weights of the reward's terms in a race of several vehicles.

    Raises:
        SettingError: a weight is not a number, or out of range (a ValueError).

    Examples:
        >>> from quadsim.learn import RacingParallelEnv
        >>> from quadsim.learn.race_task import RaceRewardWeights
        >>> env = RacingParallelEnv("figure8", racers=2, reward=RaceRewardWeights(rank=2.0))
    """

    rank: Annotated[
        float,
        setting("for each place gained in the race, negative for a place lost", ge=-MOST, le=MOST),
    ] = 1.0

    @property
    def race_params(self) -> RaceRewardParams:
        """The weights as a tuple for `race_reward`."""
        return RaceRewardParams(rank=self.rank, crash=self.crash)


def race_reward(collided, gained, p):
    """Return the additional reward of a race for a vehicle in one step.

    Args:
        collided: 1 if the vehicle has collided with another racer, else 0.
        gained: number of places gained, negative if places are lost.
        p: RaceRewardParams.
    """
    return p.rank * gained - p.crash * collided


def nearest_square(start, end):
    """Return the least squared distance from the origin to a line segment [m^2].

    The relative position of two vehicles that fly straight in a step moves along such a segment.

    Args:
        start, end: ends of the segment, (3,) each [m].
    """
    dx = end[0] - start[0]
    dy = end[1] - start[1]
    dz = end[2] - start[2]
    length = dx * dx + dy * dy + dz * dz + 1e-12
    towards = -(start[0] * dx + start[1] * dy + start[2] * dz)
    share = minimum(maximum(towards / length, 0.0), 1.0)
    x = start[0] + share * dx
    y = start[1] + share * dy
    z = start[2] + share * dz
    return x * x + y * y + z * z


@dataclass(frozen=True)
class RaceTask(LearningTask):
    """The task of a race of several vehicles; the function `race_task` makes one from names.

    Raises:
        SettingError: a number has a wrong type or is out of range (a ValueError).
    """

    racers: Annotated[int, setting("number of vehicles in a race", ge=2, le=8)] = 4
    collision_distance: Annotated[
        float,
        setting(
            "two racers whose centres come nearer than this are both out; 0: no collisions",
            unit="m",
            ge=0,
            le=0.5,
        ),
    ] = 0.1
    rewards: RaceRewardWeights = field(default_factory=RaceRewardWeights)

    def check_starts(self) -> None:
        """Raise SettingError if a racer has no room to start."""
        for course in self.courses:
            fault = start_fault(course, self.racers, self.vehicle.radius)
            if fault:
                raise SettingError("racers", f"{course.name}: {fault}")


def race_task(
    course: Any = "split_s_swift",
    vehicle: Any = "swift",
    laps: int | None = None,
    reward: Any = None,
    **settings: Any,
) -> RaceTask:
    """Return a task of several racers, with courses and vehicle given by names.

    Args:
        course, vehicle, laps: see quadsim.learn.task.task.
        reward: RaceRewardWeights, or {term: weight} for the terms that differ from the defaults.
        settings: racers, collision_distance [m], and the settings of a task of one vehicle.

    Raises:
        SettingError: a value is invalid; its message is one line (a ValueError).
        FileError: a course or a vehicle cannot be read.
    """
    found = make_task(RaceTask, RaceRewardWeights, course, vehicle, laps, reward, settings)
    found.check_starts()
    return found
