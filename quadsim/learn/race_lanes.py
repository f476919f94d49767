"""Many races of several vehicles in the compiled lanes.

The loops of LaneEnvironments step each vehicle as if it were alone; the loops of
quadsim.controllers.lanes.races add collisions, ranks and the racers' observations of each other.
Racer a of race r is lane r % LANES of block r // LANES * racers + a.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from quadsim.controllers.lanes.environment import WAIT
from quadsim.controllers.lanes.layout import LANES, blocks
from quadsim.controllers.lanes.race_loops import actions_to_lanes, observations_to_rows
from quadsim.controllers.lanes.races import NEVER, Racing, races_module
from quadsim.controllers.lanes.sharing import on_threads
from quadsim.controllers.learned.observation import SIZE
from quadsim.controllers.learned.opponents import OPPONENT_SIZE, Away, seen_opponent
from quadsim.learn.lanes import LaneEnvironments, check_courses
from quadsim.learn.race_task import (
    RaceRewardParams,
    RaceTask,
    nearest_square,
    race_reward,
)
from quadsim.streams import observation_noise_key


class Told(NamedTuple):
    """Counters of each racer after the last step.  (blocks, LANES) each"""

    row: np.ndarray  # number of the target's row
    steps: np.ndarray  # since the start
    passes: np.ndarray  # gates passed since the start


class Field(NamedTuple):
    """The vehicles of the races, which the compiled loops `meet` and `look` read and write."""

    others: np.ndarray  # (blocks, (racers - 1) * OPPONENT_SIZE, LANES) observed opponents
    out: np.ndarray  # (blocks, LANES) whether the racer was out before the last step
    collided: np.ndarray  # (blocks, LANES) whether it has collided in the last step
    rank: np.ndarray  # (blocks, LANES) from 1
    finish: np.ndarray  # (blocks, LANES) step in which it has finished, NEVER if it has not
    before: np.ndarray  # (blocks, 3, LANES) positions before the last step


class Rules(NamedTuple):
    """The numbers that `meet` reads."""

    racers: int
    too_near: np.float32  # squared distance of a collision [m^2]
    p_reward: np.ndarray  # RaceRewardParams as an array


class Looks(NamedTuple):
    """The numbers that `look` reads."""

    racers: int
    noise: np.ndarray  # ((racers - 1) * OPPONENT_SIZE,) standard deviations
    key: np.ndarray  # (2,) of the noise
    call: int  # number of this step since the seed


class RaceLanes(LaneEnvironments):
    """Many races of one task, stored in lanes.

    All racers of a race start together. A racer that has crashed, collided, finished or reached the
    time limit is out: it stays at its place, cannot collide any more and is not observed, and its
    observations and rewards are zero from the next step on. A race is over when all are out.

    Args:
        task: courses, vehicle, racers, starts and rewards.
        races: number of races.
        seed: seed of their starts.
        restart: whether a race that is over restarts in the same step.

    Attributes:
        others: observations of the opponents, nearest first
            (blocks, (racers - 1) * OPPONENT_SIZE, LANES); see
            quadsim.controllers.learned.opponents.
        out: whether the racer was out before the last step  (blocks, LANES).
        collided: whether the racer has collided with another one in this step  (blocks, LANES).
        rank: the racer's rank in the race, from 1  (blocks, LANES).
        done: whether the race has ended in this step  (groups, LANES).
        told: counters after the last step, before any restart.
        final, final_others: last observations of the racers of races that are done, if races
            restart; see `obs` and `others`.
    """

    task: RaceTask

    def __init__(self, task: RaceTask, races: int, seed: int = 0, restart: bool = False):
        self.races = races
        self.restart = restart
        super().__init__(task, blocks(races) * task.racers * LANES, seed, WAIT)
        B = len(self.X)
        opponents = (task.racers - 1) * OPPONENT_SIZE
        self.field = Field(
            others=np.zeros((B, opponents, LANES), np.float32),
            out=np.zeros((B, LANES), bool),
            collided=np.zeros((B, LANES), bool),
            rank=np.zeros((B, LANES), np.int32),
            finish=np.full((B, LANES), NEVER, np.float32),
            before=np.zeros((B, 3, LANES), np.float32),
        )
        self.others = self.field.others
        self.out = self.field.out
        self.collided = self.field.collided
        self.rank = self.field.rank
        self.final_others = np.zeros_like(self.others)
        self.done = np.zeros((blocks(races), LANES), bool)
        self.told = Told(self.row, self.steps, self.passes)
        # standard deviations of the observations of opponents; their presence is observed exactly
        self._others_noise = np.full(opponents, task.noise, np.float32)
        self._others_noise[::OPPONENT_SIZE] = 0.0
        self._rules = Rules(
            racers=task.racers,
            too_near=np.float32(task.collision_distance**2),
            p_reward=np.array(task.rewards.race_params, np.float32),
        )

    def _load_loops(self) -> None:
        super()._load_loops()
        racing = Racing(nearest_square, seen_opponent, Away, race_reward, RaceRewardParams)
        self._race_module = races_module(self.task.system, racing, SIZE)

    def __getstate__(self) -> dict[str, Any]:
        """Return everything but the compiled loops, which a copy loads again."""
        return {name: v for name, v in super().__getstate__().items() if name != "_race_module"}

    def _check_courses(self) -> None:
        check_courses(self.task, self.races, "races")

    def begin(self, seed: int | None = None, chosen: np.ndarray | None = None) -> None:
        """Start races.

        Args:
            seed: seed of a new series of races; None: the series continues.
            chosen: mask of the races that start  (groups, LANES); None: all.
        """
        if chosen is None:
            chosen = np.ones_like(self.done)
        of_racers = np.repeat(chosen, self.racers, axis=0)
        super().begin(seed, of_racers)
        self.field.finish[of_racers] = NEVER
        self.out[of_racers] = False
        self.rank[of_racers] = 0
        self._look(np.any(chosen, axis=1))

    def step(self, actions: np.ndarray) -> None:
        """Fly one step of dt.

        Args:
            actions: action of each racer, clipped to -1..1  (blocks, n_u, LANES) float32.
        """
        np.copyto(self.out, self.over)
        np.copyto(self.field.before, self.X[:, :3])
        super().step(actions)
        meet = self._race_module.meet
        groups = len(self.done)
        on_threads(meet, groups, self.episodes, self._outcome, self.field, self._rules)
        self._look(np.ones(len(self.done), bool))

        all_out = self._by_race(self.over).all(axis=1)
        was_out = self._by_race(self.out).all(axis=1)
        np.copyto(self.done, all_out & ~was_out)
        self.told = Told(self.row, self.steps, self.passes)
        if self.restart and self.done.any():
            self.told = Told(*(counts.copy() for counts in self.told))
            self._keep_final()
            self._begin_done()

    def _begin_done(self) -> None:
        """Restart the races that are over; `out` keeps its values from their last step."""
        out = self.out.copy()
        rank = self.rank.copy()
        self.begin(None, self.done)
        np.copyto(self.out, out)
        np.copyto(self.rank, rank)

    def _keep_final(self) -> None:
        """Store the last observations of the races that are over."""
        block, lane = np.nonzero(np.repeat(self.done, self.racers, axis=0))
        self.final[block, :, lane] = self.obs[block, :, lane]
        self.final_others[block, :, lane] = self.others[block, :, lane]

    def _by_race(self, lanes: np.ndarray) -> np.ndarray:
        """Return a view (groups, racers, LANES) of one number for each racer.  (blocks, LANES)"""
        return lanes.reshape(-1, self.racers, LANES)

    def _look(self, chosen: Any) -> None:
        """Compute the observations of opponents for the chosen groups of races.  (groups,)"""
        looks = Looks(
            racers=self.racers,
            noise=self._others_noise,
            key=observation_noise_key(self.seed),
            call=self._calls,
        )
        look = self._race_module.look
        on_threads(look, len(chosen), self.episodes, self.field, looks, chosen)

    def actions_to_lanes(self, rows: np.ndarray, lanes: np.ndarray) -> None:
        """Copy actions (races, racers, n_u) to lanes  (blocks, n_u, LANES)."""
        on_threads(actions_to_lanes, len(self.done), rows, lanes)

    def observations_to_rows(self, obs: np.ndarray, others: np.ndarray, rows: np.ndarray) -> None:
        """Copy the observations `obs` and `others` to rows  (races, racers, numbers)."""
        on_threads(observations_to_rows, len(self.done), obs, others, rows)
