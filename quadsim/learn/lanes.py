"""Many environments in the compiled lanes: their state, and the calls that step and restart them.

Arrays are laid out as in quadsim.controllers.lanes.layout: environment i is lane i % LANES of block
i // LANES.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from quadsim.config.settings import SettingError
from quadsim.controllers.costs.race import clearance, progress
from quadsim.controllers.lanes.environment import DISABLED, Learning, environment_module
from quadsim.controllers.lanes.episode_loops import to_lanes, to_rows
from quadsim.controllers.lanes.layout import LANES, blocks
from quadsim.controllers.lanes.sharing import on_threads
from quadsim.controllers.learned.observation import GATE_NUMBERS, SIZE, NextGates, observation
from quadsim.learn.reward import RewardParams, RewardWeights, reward
from quadsim.learn.task import LearningTask, Tables, tables
from quadsim.streams import observation_noise_key


class Episodes(NamedTuple):
    """The running episodes, which the compiled loops `begin` and `advance` write."""

    states: np.ndarray  # (blocks, n_x, LANES)
    rows: np.ndarray  # (blocks, n_row, LANES) row of the target
    models: np.ndarray  # (blocks, n_p, LANES) parameters of the vehicles
    actions_before: np.ndarray  # (blocks, n_u, LANES) last actions
    way: np.ndarray  # (blocks, LANES) to the remaining gates [m]
    room: np.ndarray  # (blocks, LANES) to the obstacles [m]
    row: np.ndarray  # (blocks, LANES) number of the target's row
    steps: np.ndarray  # (blocks, LANES) since the episode began
    passes: np.ndarray  # (blocks, LANES) gates passed since the episode began
    episode: np.ndarray  # (blocks, LANES) number of the episode
    over: np.ndarray  # (blocks, LANES) whether it has ended and waits for its restart
    obs: np.ndarray  # (blocks, SIZE, LANES)


class Beginnings(NamedTuple):
    """The arrays from which episodes begin."""

    starts: np.ndarray  # (courses, starts, n_x + 1 + n_p + n_u)
    targets: np.ndarray  # (courses, rows, n_row)
    course: np.ndarray  # (blocks,)
    seed: int


class Outcome(NamedTuple):
    """The results of a step, which `advance` writes."""

    final: np.ndarray  # (blocks, SIZE, LANES) last observation of an episode that starts anew
    reward_of: np.ndarray  # (blocks, LANES)
    ended: np.ndarray  # (blocks, LANES)
    cut: np.ndarray  # (blocks, LANES) whether the time limit has ended the episode
    passed: np.ndarray  # (blocks, LANES) whether a gate was passed
    crashed_now: np.ndarray  # (blocks, LANES)


class Step(NamedTuple):
    """The numbers of one step and of the task, which `advance` reads."""

    actions: np.ndarray  # (blocks, n_u, LANES)
    call: int  # number of this step since the seed
    dt: np.float32  # [s]
    low: np.ndarray  # (n_u,) commands at -1
    half: np.ndarray  # (n_u,) half of their ranges
    p_cost: np.ndarray  # (courses, n_q)
    last_row: np.ndarray  # (courses,) row at which a race is finished
    obstacles: np.ndarray  # (courses, obstacles, n_obstacle)
    n_obstacles: np.ndarray  # (courses,)
    limit: np.int32  # steps of the longest episode
    mode: int  # SAME_STEP, NEXT_STEP, DISABLED or WAIT
    p_reward: np.ndarray  # RewardParams as an array
    noise: np.ndarray  # (SIZE,) standard deviations of the observation; negative: no noise
    key: np.ndarray  # (2,) of the noise


class LaneEnvironments:
    """Many environments of one task, stored in lanes.

    Args:
        task: courses, vehicle, starts and rewards.
        n: number of environments.
        seed: seed of their starts.
        autoreset: step in which an ended episode restarts: SAME_STEP, NEXT_STEP or DISABLED. With
            WAIT it does not restart, and the vehicle stays at its place.

    Attributes:
        racers: number of consecutive blocks that share races; lane i of each holds one racer of
            race i.
        X: states (blocks, n_x, LANES).
        row: indices of the target rows  (blocks, LANES).
        steps, passes: numbers of steps and of passed gates in the episodes  (blocks, LANES).
        obs: observations (blocks, SIZE, LANES).
        final: last observations of episodes that restart in the same step.
        reward, ended, cut, hit, crashed: results of the last step  (blocks, LANES). `cut` means
            ended by the time limit, and `hit` means that a gate was passed.
    """

    def __init__(self, task: LearningTask, n: int, seed: int = 0, autoreset: int = DISABLED):
        self.task = task
        self.racers = task.racers
        self.n = n
        self.seed = seed
        self.autoreset = autoreset
        self._check_courses()
        self.tables: Tables | None = None  # drawn from the seed when episodes begin
        self._calls = 0

        system = task.system
        cost = task.cost(0)
        self._load_loops()

        B = blocks(n)
        n_row = cost.targets.shape[1] + 2 * GATE_NUMBERS

        def numbers(*rows: int) -> np.ndarray:
            return np.zeros((B, *rows, LANES), np.float32)

        def counts() -> np.ndarray:
            return np.zeros((B, LANES), np.int32)

        def flags() -> np.ndarray:
            return np.zeros((B, LANES), bool)

        self.episodes = Episodes(
            states=numbers(len(system.states)),
            rows=numbers(n_row),
            models=numbers(len(system.params)),
            actions_before=numbers(len(system.controls)),
            way=numbers(),
            room=numbers(),
            row=counts(),
            steps=counts(),
            passes=counts(),
            episode=counts(),
            over=flags(),
            obs=numbers(SIZE),
        )
        self._outcome = Outcome(
            final=numbers(SIZE),
            reward_of=numbers(),
            ended=flags(),
            cut=flags(),
            passed=flags(),
            crashed_now=flags(),
        )
        self.course = self._course_of_blocks(B)
        self.X = self.episodes.states
        self.last = self.episodes.actions_before
        self.obs = self.episodes.obs
        self.way = self.episodes.way
        self.room = self.episodes.room
        self.row = self.episodes.row
        self.steps = self.episodes.steps
        self.passes = self.episodes.passes
        self.over = self.episodes.over
        self.final = self._outcome.final
        self.reward = self._outcome.reward_of
        self.ended = self._outcome.ended
        self.cut = self._outcome.cut
        self.hit = self._outcome.passed
        self.crashed = self._outcome.crashed_now

        self._low = np.array(system.low, np.float32)
        self._half = (np.array(system.high, np.float32) - self._low) / 2
        self._noise = np.full(SIZE, task.noise if task.noise > 0 else -1.0, np.float32)
        self._limit = np.int32(round(task.time_limit / task.dt))
        self._dt = np.float32(task.dt)
        self.reward_by(task.rewards)

    def _load_loops(self) -> None:
        """Load the compiled loops of the task."""
        learning = Learning(observation, NextGates, reward, RewardParams, progress, clearance)
        self._module = environment_module(self.task.system, self.task.cost(0), learning)

    def __getstate__(self) -> dict[str, Any]:
        """Return everything but the compiled loops, which a copy loads again."""
        return {name: value for name, value in self.__dict__.items() if name != "_module"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._load_loops()

    def reward_by(self, weights: RewardWeights) -> None:
        """Set the weights of the reward; the margin of the task does not change."""
        self.rewards = weights
        self._rewards = np.array(weights.params, np.float32)

    def begin(self, seed: int | None = None, chosen: np.ndarray | None = None) -> None:
        """Start episodes.

        Args:
            seed: seed of a new series of episodes; None: the series continues.
            chosen: mask of the environments whose episodes start  (blocks, LANES); None: all.
        """
        if seed is not None or self.tables is None:
            self.seed = self.seed if seed is None else seed
            self._calls = 0
            self.tables = tables(self.task, self.seed)
            self.episodes.episode[:] = 0
        if chosen is None:
            chosen = np.ones_like(self.over)
        beginnings = self._beginnings(self.tables)
        begin = self._module.begin
        on_threads(begin, len(self.X), self.episodes, beginnings, chosen, self.racers)

    def step(self, actions: np.ndarray) -> None:
        """Fly one step of dt.

        Args:
            actions: action of each environment, clipped to -1..1  (blocks, n_u, LANES) float32.
        """
        assert self.tables is not None, "step before begin"
        self._calls += 1
        step = Step(
            actions=actions,
            call=self._calls,
            dt=self._dt,
            low=self._low,
            half=self._half,
            p_cost=self.tables.p_cost,
            last_row=self.tables.final_row,
            obstacles=self.tables.obstacles,
            n_obstacles=self.tables.n_obstacles,
            limit=self._limit,
            mode=self.autoreset,
            p_reward=self._rewards,
            noise=self._noise,
            key=observation_noise_key(self.seed),
        )
        beginnings = self._beginnings(self.tables)
        advance = self._module.advance
        on_threads(advance, len(self.X), self.episodes, beginnings, step, self._outcome)

    def rows_to_lanes(self, rows: np.ndarray, lanes: np.ndarray) -> None:
        """Copy rows, one for each environment (environments, n), to lanes (blocks, n, LANES)."""
        on_threads(to_lanes, len(lanes), rows, lanes)

    def lanes_to_rows(self, lanes: np.ndarray, rows: np.ndarray) -> None:
        """Copy lanes (blocks, n, LANES) to rows, one for each environment (environments, n)."""
        on_threads(to_rows, len(lanes), lanes, rows)

    def _beginnings(self, found: Tables) -> Beginnings:
        return Beginnings(found.starts, found.targets, self.course, self.seed)

    def _course_of_blocks(self, blocks: int) -> np.ndarray:
        """Return the row of the tables that each block uses.  (blocks,) int32"""
        block = np.arange(blocks)
        course = block // self.racers % len(self.task.courses)
        return (course * self.racers + block % self.racers).astype(np.int32)

    def _check_courses(self) -> None:
        """Raise SettingError unless the courses fit the n environments."""
        check_courses(self.task, self.n, "environments")


def check_courses(task: LearningTask, n: int, what: str) -> None:
    """Raise SettingError unless a task's courses fit n environments or races.

    Args:
        task: the task.
        n: number of environments or races.
        what: "environments" or "races", for the error.
    """
    count = len(task.courses)
    if count > blocks(n):
        least = LANES * (count - 1) + 1
        wanted = f"expected at least {least} {what} for {count}"
        raise SettingError("course", f"{LANES} {what} share a course: {wanted}, got {n}")
    costs = [task.cost(k) for k in range(count)]
    # the compiled module contains one obstacle test for all courses
    tests = {cost.obstacles.touches for cost in costs if cost.obstacles}
    if len(tests) > 1:
        wanted = "expected courses that all have obstacles beside the gates, or none"
        raise SettingError("course", f"{wanted}, got both")
