"""`quadsim/Racing-v0` for many vehicles at once: a gymnasium VectorEnv on the compiled lanes."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from controllers.lanes.environment import DISABLED, NEXT_STEP, SAME_STEP
from controllers.lanes.layout import LANES
from controllers.lanes.threads import use_threads
from controllers.learned.observation import SIZE
from quadsim.dynamics.quadrotor import POSE
from quadsim.learn.lanes import LaneEnvironments
from quadsim.learn.recycled import Recycled
from quadsim.learn.render import RENDER_MODES, Renderer
from quadsim.learn.spaces import ACTIONS, action_space, checked_actions, observation_space
from quadsim.learn.task import task
from quadsim.spec.settings import SettingError
from quadsim.streams import fresh_seed

MODES = {
    AutoresetMode.SAME_STEP: SAME_STEP,
    AutoresetMode.NEXT_STEP: NEXT_STEP,
    AutoresetMode.DISABLED: DISABLED,
}


class RacingVectorEnv(VectorEnv):
    """Races of many vehicles. Same seed, same rollout to the last bit, for any number of threads.

    Args:
        num_envs: vehicles. LANES = 64 in a row share a course.
        course, vehicle, laps, reward, dt, start, randomize, time_limit, noise: see
            quadsim.learn.task.task.
        autoreset_mode: when an episode that has ended starts anew; NEXT_STEP unless asked
            otherwise.
        threads: CPU threads of this process; None: as they are.

    Raises:
        SettingError, FileError: a value that does not fit (both are ValueError).
    """

    metadata = {  # noqa: RUF012 (Gymnasium declares it so)
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": list(RENDER_MODES),
        "render_fps": 100,
    }

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        render_mode: str | None = None,
        **of_task: Any,
    ):
        if isinstance(num_envs, bool) or not isinstance(num_envs, int | np.integer) or num_envs < 1:
            raise SettingError(
                "num_envs", f"expected a whole number of at least 1, got {num_envs!r}"
            )
        try:
            mode = AutoresetMode(autoreset_mode)
        except ValueError:
            names = ", ".join(m.value for m in AutoresetMode)
            raise SettingError(
                "autoreset_mode", f"expected one of {names}, got {autoreset_mode!r}"
            ) from None
        if threads is not None:
            use_threads(threads)
        self.num_envs, self.render_mode = int(num_envs), render_mode
        self.task = task(**of_task)
        self._renderer = Renderer(render_mode, self.task.courses[0], self.num_envs, self.task.dt)
        self.metadata = self.metadata | {
            "autoreset_mode": mode,
            "render_fps": round(1 / self.task.dt),
        }
        self.single_observation_space, self.single_action_space = (
            observation_space(),
            action_space(),
        )
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.lanes = LaneEnvironments(self.task, self.num_envs, 0, MODES[mode])
        self._actions = np.zeros((len(self.lanes.X), ACTIONS, LANES), np.float32)
        self._spare, self._begun = Recycled((self.num_envs, SIZE)), False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start episodes; of those in options["reset_mask"] (num_envs,) alone, if it is given."""
        if seed is None and not self._begun:
            seed = fresh_seed()
        super().reset(seed=seed)
        mask = (options or {}).get("reset_mask")
        if mask is not None and (
            np.shape(mask) != (self.num_envs,) or np.asarray(mask).dtype != bool
        ):
            wanted = f"expected booleans of shape ({self.num_envs},)"
            raise ValueError(
                f"reset_mask: {wanted}, got {np.asarray(mask).dtype} of shape {np.shape(mask)}"
            )
        chosen = np.ones_like(self.lanes.over)
        if mask is not None:
            chosen.ravel()[: self.num_envs] = mask
        self.lanes.begin(None if seed is None else int(seed), chosen)
        self._begun = True
        self._renderer.update(self._state_rows)
        return self._rows(self.lanes.obs), {}

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One step of dt; actions (num_envs, 4), what lies outside of -1..1 is clipped.

        Returns:
            Observations (num_envs, 38), rewards, terminations, truncations (num_envs,), and info:
            `passed`, whether a gate was passed in this step, `gates`, how many since the episode
            began, `lap` (from 1), `time` [s], `crashed`, `finished`; with SAME_STEP also
            `final_obs` where `_final_obs`.

        Raises:
            ValueError: actions of another shape, or not finite.
            gymnasium.error.ResetNeeded: before the first reset; without autoreset, after an episode
                has ended.
        """
        e, n = self.lanes, self.num_envs
        if not self._begun:
            raise ResetNeeded("Racing-v0: step() before reset()")
        if e.autoreset == DISABLED and e.over.ravel()[:n].any():
            ended = int(np.flatnonzero(e.over.ravel()[:n])[0])
            raise ResetNeeded(
                f"Racing-v0: the episode of environment {ended} has ended: reset it by reset_mask"
            )
        e.rows_to_lanes(checked_actions(actions, (n, ACTIONS)), self._actions)
        before = e.steps.copy(), e.passes.copy(), e.row.copy()
        e.step(self._actions)
        self._renderer.update(self._state_rows)
        of_step = before[0] + 1, before[1] + e.hit, before[2]
        info = (
            self._info(*of_step)
            if e.autoreset == SAME_STEP
            else self._info(e.steps, e.passes, e.row)
        )
        return self._rows(e.obs), self._one(e.reward), self._one(e.ended), self._one(e.cut), info

    def _info(self, steps: np.ndarray, gates: np.ndarray, row: np.ndarray) -> dict[str, Any]:
        """Of the episode that this step belongs to, also where the next one has begun."""
        e = self.lanes
        number = np.array([len(c.gates) for c in self.task.courses], np.int32)[e.course][:, None]
        info = {
            "passed": self._one(e.hit),
            "gates": self._one(gates),
            "lap": self._one(row // number + 1),
            "time": self._one(steps) * np.float32(self.task.dt),
            "crashed": self._one(e.crashed),
            "finished": self._one(e.ended & ~e.crashed),
        }
        if e.autoreset == SAME_STEP:
            done = self._one(e.ended | e.cut)
            if done.any():
                info |= {"final_obs": self._rows(e.final), "_final_obs": done}
        return info

    def render(self) -> Any:
        """With rgb_array a picture of all vehicles on the first course: (height, width, 3) uint8,
        in a tuple."""
        found = self._renderer.picture(self._state_rows())
        return None if found is None else (found,)

    def close_extras(self, **kwargs: Any) -> None:
        """The page of render_mode human ends."""
        self._renderer.close()

    def _state_rows(self) -> np.ndarray:
        """Position, velocity and attitude.  (num_envs, 10)"""
        shown = self.lanes.X[:, POSE].transpose(0, 2, 1)  # (blocks, LANES, 10)
        return shown.reshape(-1, shown.shape[2])[: self.num_envs]

    def _one(self, lanes: np.ndarray) -> np.ndarray:
        """One number for each environment, a copy."""
        return lanes.ravel()[: self.num_envs].copy()

    def _rows(self, lanes: np.ndarray) -> np.ndarray:
        rows = self._spare.take()
        self.lanes.lanes_to_rows(lanes, rows)
        return rows
