"""Many environments in the compiled lanes: their state, and the calls that step and restart them.

Arrays lie as in controllers.lanes.layout: environment i is lane i % LANES of block i // LANES.
"""

from __future__ import annotations

import numpy as np

from controllers.costs.race import clearance, progress
from controllers.lanes.environment import DISABLED, Learning, environment_module
from controllers.lanes.layout import LANES, blocks
from controllers.lanes.threads import threads
from controllers.learned.observation import GATE_NUMBERS, SIZE, NextGates, observation
from quadsim.learn.reward import RewardParams, RewardWeights, reward
from quadsim.learn.task import Tables, Task, tables
from quadsim.spec.settings import SettingError
from quadsim.streams import observation_noise_key


class LaneEnvironments:
    """`n` environments of a task. After each step: obs, reward, ended, cut, and what happened, all
    in lanes.

    Attributes:
        X: states (blocks, n_x, LANES); row: of targets; steps and passes of the episode (blocks,
            LANES).
        obs: (blocks, SIZE, LANES); final: of episodes that ended in this step, where they start
            anew in the same.
        reward, ended, cut, hit, crashed: (blocks, LANES); cut: ended by the time limit; hit: a gate
            was passed.
    """

    def __init__(self, task: Task, n: int, seed: int = 0, autoreset: int = DISABLED):
        self.task, self.n, self.seed, self.autoreset = task, n, seed, autoreset
        system, cost = task.system, task.cost(0)
        assert cost.obstacles
        B, f = blocks(n), np.float32
        if len(task.courses) > B:
            least = LANES * (len(task.courses) - 1) + 1
            wanted = f"expected at least {least} environments for {len(task.courses)}"
            raise SettingError("course", f"{LANES} environments share a course: {wanted}, got {n}")
        tests = {
            other.obstacles.touches
            for other in map(task.cost, range(len(task.courses)))
            if other.obstacles
        }
        if len(tests) > 1:
            raise SettingError(
                "course",
                "expected courses that all have obstacles beside the gates, or none, got both",
            )
        self.tables: Tables | None = None  # of the seed, made when episodes begin
        n_x = len(system.states)
        n_u = len(system.controls)
        n_p = len(system.params)
        n_row = cost.targets.shape[1] + 2 * GATE_NUMBERS
        learning = Learning(observation, NextGates, reward, RewardParams, progress, clearance)
        self._module = environment_module(system, cost, learning)
        self.X, self.A, self.P, self.last, self.obs, self.final = (
            np.zeros((B, k, LANES), f) for k in (n_x, n_row, n_p, n_u, SIZE, SIZE)
        )
        self.way, self.room, self.reward = (np.zeros((B, LANES), f) for _ in range(3))
        self.row, self.steps, self.passes, self.episode = (
            np.zeros((B, LANES), np.int32) for _ in range(4)
        )
        self.over, self.ended, self.cut, self.hit, self.crashed = (
            np.zeros((B, LANES), bool) for _ in range(5)
        )
        self.course = (np.arange(B) % len(task.courses)).astype(np.int32)
        low, high = np.array(system.low, f), np.array(system.high, f)
        self._command = low, (high - low) / 2
        self._noise = np.full(SIZE, task.noise if task.noise > 0 else -1.0, f)
        self._limit, self._dt = np.int32(round(task.time_limit / task.dt)), f(task.dt)
        self.reward_by(task.rewards)
        self._calls = 0
        self.rows_to_lanes, self.lanes_to_rows = self._module.to_lanes, self._module.to_rows

    def reward_by(self, weights: RewardWeights) -> None:
        """From now on; the margin of the task stays."""
        self.rewards, self._rewards = weights, np.array(weights.params, np.float32)

    def begin(self, seed: int | None = None, chosen: np.ndarray | None = None) -> None:
        """Start episodes: of all environments, or of those chosen (blocks, LANES). A seed starts
        the series anew."""
        if seed is not None or self.tables is None:
            self.seed, self._calls = self.seed if seed is None else seed, 0
            self.tables = tables(self.task, self.seed)
            self.episode[:] = 0
        chosen = np.ones_like(self.over) if chosen is None else chosen
        t = self.tables
        self._module.begin(
            *self._state, self.obs, t.starts, t.targets, self.course, self.seed, chosen
        )

    def step(self, actions: np.ndarray) -> None:
        """One step of dt under actions (blocks, n_u, LANES) in -1..1, float32; what lies outside is
        clipped."""
        t, self._calls = self.tables, self._calls + 1
        assert t is not None, "step before begin"
        key = observation_noise_key(self.seed)
        self._module.advance(
            *self._state, self.obs, t.starts, t.targets, self.course, self.seed, t.p_cost, self._dt, actions,
            self.final, self.reward, self.ended, self.cut, self.hit, self.crashed, t.final_row, t.obstacles,
            t.n_obstacles, *self._command, self._limit, self.autoreset, self._rewards, self._noise, key, self._calls,
            min(len(self.X), 4 * threads()),
        )  # fmt: skip

    @property
    def _state(self) -> tuple[np.ndarray, ...]:
        return (
            self.X,
            self.A,
            self.P,
            self.last,
            self.way,
            self.room,
            self.row,
            self.steps,
            self.passes,
            self.episode,
            self.over,
        )
