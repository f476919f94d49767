"""Many races of several vehicles, with arrays of shape (races, racers, ...)."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from gymnasium.error import ResetNeeded
from msgspec import Meta, inspect

from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.threads import use_threads
from quadsim.controllers.learned.observation import SIZE
from quadsim.controllers.learned.opponents import OPPONENT_SIZE
from quadsim.dynamics.quadrotor import POSE
from quadsim.files.values import checked_object
from quadsim.learn.race_lanes import RaceLanes
from quadsim.learn.race_task import race_task
from quadsim.learn.spaces import ACTIONS, checked_actions, checked_reset
from quadsim.streams import fresh_seed

COUNT = inspect.type_info(Annotated[int, Meta(ge=1, le=10**7)])


class Races:
    """Many races of several vehicles each, for training on all of them at once.

    A racer that is out waits, with observations and rewards of zero, until every racer of its race
    has finished, crashed, collided or reached the time limit. The race then restarts in the same
    step. The same seed gives the same numbers to the last bit, for any number of threads.

    Args:
        races: number of races; LANES = 64 consecutive races share a course.
        restart: whether races that are over restart; otherwise their racers stay out.
        threads: CPU threads of this process; None does not change them.
        settings: course, vehicle, laps, reward, racers, collision_distance, dt, start, randomize,
            time_limit and noise; see quadsim.learn.race_task.race_task.

    Raises:
        SettingError, FileError: a value is invalid (both are ValueError).

    Examples:
        >>> from quadsim.learn.races import Races
        >>> races = Races(64, course="figure8", racers=3, start="anywhere")
        >>> races.reset(seed=0).shape
        (64, 3, 52)
    """

    def __init__(
        self, races: int = 64, *, restart: bool = True, threads: int | None = None, **settings: Any
    ):
        self.races = checked_object("races", races, COUNT)
        if threads is not None:
            use_threads(threads)
        self.task = race_task(**settings)
        self.racers = self.task.racers
        self.size = observation_size(self.racers)
        self.lanes = RaceLanes(self.task, self.races, 0, restart)
        self._actions = np.zeros((len(self.lanes.X), ACTIONS, LANES), np.float32)
        gates = [len(course.gates) for course in self.task.courses]
        # Gates per lap of each block's course, as a column that broadcasts over its lanes
        courses = self.lanes.course // self.racers
        self._gates_per_lap = np.array(gates, np.int32)[courses][:, None]
        self._begun = False

    def reset(self, seed: int | None = None) -> np.ndarray:
        """Start all races and return observations (races, racers, size).

        Args:
            seed: seed of a new series of races, 0 to 2^63 - 1; None: the series continues.

        Raises:
            SettingError: the seed is not an integer, or out of range.
        """
        seed = checked_reset(seed, None)
        if seed is None and not self._begun:
            seed = fresh_seed()
        self.lanes.begin(seed)
        self._begun = True
        return self._rows(self.lanes.obs, self.lanes.others)

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray]]:
        """Fly one step of dt.

        Args:
            actions: (races, racers, 4), clipped to -1..1; actions of racers that are out have no
                effect.

        Returns:
            Observations (races, racers, size), rewards, terminations, truncations (races, racers),
            and info of the same shape: `racing`, whether the racer took part in this step, `passed`
            a gate, `gates` passed since the start, `lap` (from 1), `time` [s], `crashed`,
            `collided` with another racer, `finished`, `rank` (from 1). `over` (races,) marks the
            races that have ended in this step; if they restart, `final_obs`
            (races that ended, racers, size) has their last observations.

        Raises:
            ValueError: the actions have a wrong shape, or are not finite.
            gymnasium.error.ResetNeeded: before the first reset.
        """
        if not self._begun:
            raise ResetNeeded("Races: step() before reset()")
        e = self.lanes
        given = checked_actions(actions, (self.races, self.racers, ACTIONS))
        e.actions_to_lanes(given, self._actions)
        e.step(self._actions)
        reward, ended, cut = (self._by_race(found) for found in (e.reward, e.ended, e.cut))
        return self._rows(e.obs, e.others), reward, ended, cut, self._info(ended)

    def _info(self, ended: np.ndarray) -> dict[str, np.ndarray]:
        """Return the info of the last step.

        Args:
            ended: terminations (races, racers).
        """
        e = self.lanes
        crashed = self._by_race(e.crashed)
        over = e.done.ravel()[: self.races].copy()
        told = e.told
        info = {
            "racing": ~self._by_race(e.out),
            "passed": self._by_race(e.hit),
            "gates": self._by_race(told.passes),
            "lap": self._by_race(told.row // self._gates_per_lap + 1),
            "time": self._by_race(told.steps) * np.float32(self.task.dt),
            "crashed": crashed,
            "collided": self._by_race(e.collided),
            "finished": ended & ~crashed,
            "rank": self._by_race(e.rank),
            "over": over,
        }
        if e.restart and over.any():
            info["final_obs"] = self._final_rows(np.flatnonzero(over))
        return info

    def state_rows(self) -> np.ndarray:
        """Return position, velocity and attitude of each racer.  (races, racers, 10)"""
        by_lane = self.lanes.X[:, POSE].transpose(0, 2, 1)  # (blocks, LANES, 10)
        by_group = by_lane.reshape(-1, self.racers, LANES, by_lane.shape[2])
        by_race = by_group.transpose(0, 2, 1, 3)  # (groups, LANES, racers, 10)
        return by_race.reshape(-1, self.racers, by_lane.shape[2])[: self.races]

    def _by_race(self, lanes: np.ndarray) -> np.ndarray:
        """Return a copy of one number of each racer.  (blocks, LANES) -> (races, racers)"""
        groups = lanes.reshape(-1, self.racers, LANES).transpose(0, 2, 1)
        return np.array(groups.reshape(-1, self.racers)[: self.races], order="C")

    def _rows(self, obs: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return a copy of the observations by race.  (races, racers, size)"""
        rows = np.empty((self.races, self.racers, self.size), np.float32)
        self.lanes.observations_to_rows(obs, others, rows)
        return rows

    def _final_rows(self, races: np.ndarray) -> np.ndarray:
        """Return the last observations of these races.  (n,) -> (n, racers, size)"""
        e = self.lanes
        block = (races // LANES * self.racers)[:, None] + np.arange(self.racers)
        lane = (races % LANES)[:, None]
        own = e.final[block, :, lane]
        others = e.final_others[block, :, lane]
        return np.concatenate([own, others], axis=2)


def observation_size(racers: int) -> int:
    """Return the size of a racer's observation: its own numbers, and some for each opponent."""
    return SIZE + (racers - 1) * OPPONENT_SIZE
