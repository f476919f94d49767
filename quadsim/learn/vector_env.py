"""`quadsim/Racing-v0` for many vehicles at once: a gymnasium VectorEnv on the compiled lanes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from msgspec import Meta, inspect

from quadsim.controllers.lanes.environment import DISABLED, NEXT_STEP, SAME_STEP
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.threads import use_threads
from quadsim.controllers.learned.observation import SIZE
from quadsim.dynamics.quadrotor import POSE
from quadsim.files.values import SettingError, checked_object
from quadsim.files.yaml_errors import shown_value
from quadsim.learn.lanes import LaneEnvironments
from quadsim.learn.render import RENDER_MODES, Renderer, ViewerFactory
from quadsim.learn.spaces import (
    ACTIONS,
    action_space,
    checked_actions,
    checked_reset,
    observation_space,
)
from quadsim.learn.task import task
from quadsim.streams import fresh_seed

COUNT = inspect.type_info(Annotated[int, Meta(ge=1)])
RESET_MASK = "reset_mask"  # name of the option of a reset
BYTES = 1500  # least memory of one environment and of the results of its step

MODES = {
    AutoresetMode.SAME_STEP: SAME_STEP,
    AutoresetMode.NEXT_STEP: NEXT_STEP,
    AutoresetMode.DISABLED: DISABLED,
}


class RacingVectorEnv(VectorEnv):
    """Many races of one vehicle each, a vector environment of Gymnasium.

    The same seed gives the same rollout to the last bit, for any number of threads.

    Args:
        num_envs: number of vehicles; LANES = 64 consecutive vehicles share a course.
        autoreset_mode: step in which an ended episode restarts.
        threads: CPU threads of this process; None does not change them.
        render_mode: None or "rgb_array".
        viewer: function that makes a viewer for every step from the course, the number of vehicles
            and the duration of a step [s], such as quadsim.web.page.env_page.EnvPage.
        settings: course, vehicle, laps, reward, dt, start, randomize, time_limit and noise; see
            quadsim.learn.task.task.

    Raises:
        SettingError, FileError: a value is invalid (both are ValueError).

    Examples:
        >>> from quadsim.learn.vector_env import RacingVectorEnv
        >>> envs = RacingVectorEnv(64, course="figure8", start="anywhere")
        >>> observations, info = envs.reset(seed=0)
        >>> observations.shape
        (64, 38)
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
        viewer: ViewerFactory | None = None,
        **settings: Any,
    ):
        self.num_envs = _checked_count(num_envs)
        mode = _mode(autoreset_mode)
        if threads is not None:
            use_threads(threads)
        self.render_mode = render_mode
        self.task = task(**settings)
        dt = self.task.dt
        course = self.task.courses[0]
        self._renderer = Renderer(render_mode, viewer, course, self.num_envs, dt)
        self.metadata = self.metadata | {"autoreset_mode": mode, "render_fps": round(1 / dt)}
        self.single_observation_space = observation_space()
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.lanes = LaneEnvironments(self.task, self.num_envs, 0, MODES[mode])
        self._actions = np.zeros((len(self.lanes.X), ACTIONS, LANES), np.float32)
        gates = [len(course.gates) for course in self.task.courses]
        # Gates per lap of each block's course, as a column that broadcasts over its lanes
        self._gates_per_lap = np.array(gates, np.int32)[self.lanes.course][:, None]
        self._begun = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start episodes and return observations (num_envs, 38).

        Args:
            seed: seed of a new series of episodes, 0 to 2^63 - 1; None: the series continues.
            options: "reset_mask", booleans (num_envs,), selects the environments to reset; by
                default all are reset.

        Raises:
            SettingError: the seed is not an integer or out of range, or another option is given.
            ValueError: the mask has a wrong shape or type.
        """
        seed = checked_reset(seed, options, (RESET_MASK,))
        if seed is None and not self._begun:
            seed = fresh_seed()
        super().reset(seed=seed)
        chosen = np.ones_like(self.lanes.over)
        mask = (options or {}).get(RESET_MASK)
        if mask is not None:
            chosen.ravel()[: self.num_envs] = self._checked_mask(mask)
        self.lanes.begin(seed, chosen)
        self._begun = True
        self._renderer.update(self._state_rows)
        return self._rows(self.lanes.obs), {}

    def step(
        self, actions: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Fly one step of dt.

        Args:
            actions: action of each vehicle, clipped to -1..1  (num_envs, 4).

        Returns:
            Observations (num_envs, 38), rewards, terminations, truncations (num_envs,), and info:
            `passed`, whether a gate was passed in this step, `gates`, the number of gates passed
            since the episode began, `lap` (from 1), `time` [s], `crashed`, `finished`; with
            SAME_STEP also `final_obs`, valid where `_final_obs`.

        Raises:
            ValueError: the actions have a wrong shape, or are not finite.
            gymnasium.error.ResetNeeded: before the first reset; without autoreset, after an episode
                has ended.
        """
        e = self.lanes
        if not self._begun:
            raise ResetNeeded("Racing-v0: step() before reset()")
        if e.autoreset == DISABLED and self._used(e.over).any():
            ended = int(np.flatnonzero(self._used(e.over))[0])
            problem = f"the episode of environment {ended} has ended: reset it by {RESET_MASK}"
            raise ResetNeeded(f"Racing-v0: {problem}")
        e.rows_to_lanes(checked_actions(actions, (self.num_envs, ACTIONS)), self._actions)
        steps = e.steps.copy()
        passes = e.passes.copy()
        row = e.row.copy()
        e.step(self._actions)
        self._renderer.update(self._state_rows)
        if e.autoreset == SAME_STEP:
            # info belongs to the episode of this step, even if the next one has begun
            info = self._info(steps + 1, passes + e.hit, row)
        else:
            info = self._info(e.steps, e.passes, e.row)
        reward = self._used(e.reward).copy()
        ended = self._used(e.ended).copy()
        cut = self._used(e.cut).copy()
        return self._rows(e.obs), reward, ended, cut, info

    def render(self) -> tuple[np.ndarray] | None:
        """Return a picture of all vehicles on the first course if the mode is rgb_array.

        Returns:
            A tuple of one picture (height, width, 3) uint8, or None.
        """
        found = self._renderer.picture(self._state_rows())
        return None if found is None else (found,)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the viewer."""
        self._renderer.close()

    def _checked_mask(self, mask: Any) -> np.ndarray:
        """Return the mask. Raises ValueError unless it consists of booleans (num_envs,)."""
        found = np.asarray(mask)
        if found.shape != (self.num_envs,) or found.dtype != bool:
            wanted = f"expected booleans of shape ({self.num_envs},)"
            raise ValueError(f"reset_mask: {wanted}, got {found.dtype} of shape {found.shape}")
        return found

    def _info(self, steps: np.ndarray, passes: np.ndarray, row: np.ndarray) -> dict[str, Any]:
        """Return the info of a step from counters of its episode.  (blocks, LANES) each"""
        e = self.lanes
        info = {
            "passed": self._used(e.hit).copy(),
            "gates": self._used(passes).copy(),
            "lap": self._used(row // self._gates_per_lap + 1),
            "time": self._used(steps) * np.float32(self.task.dt),
            "crashed": self._used(e.crashed).copy(),
            "finished": self._used(e.ended & ~e.crashed),
        }
        if e.autoreset == SAME_STEP:
            done = self._used(e.ended | e.cut)
            if done.any():
                info["final_obs"] = self._rows(e.final)
                info["_final_obs"] = done
        return info

    def _state_rows(self) -> np.ndarray:
        """Return position, velocity and attitude of each vehicle.  (num_envs, 10)"""
        by_lane = self.lanes.X[:, POSE].transpose(0, 2, 1)  # (blocks, LANES, 10)
        return by_lane.reshape(-1, by_lane.shape[2])[: self.num_envs]

    def _used(self, lanes: np.ndarray) -> np.ndarray:
        """Return a view with one number for each environment.  (blocks, LANES) -> (num_envs,)"""
        return lanes.ravel()[: self.num_envs]

    def _rows(self, lanes: np.ndarray) -> np.ndarray:
        """Return a copy of the observations by environment.  (num_envs, 38)"""
        rows = np.empty((self.num_envs, SIZE), np.float32)
        self.lanes.lanes_to_rows(lanes, rows)
        return rows


def _checked_count(given: Any) -> int:
    """Return the number of environments.

    Raises:
        SettingError: the number is not whole or below 1, or needs more memory than is free.
    """
    count = checked_object("num_envs", given, COUNT)
    most = free_memory() // BYTES
    if count > most:
        wanted = f"expected at most {most}, as each needs {BYTES} bytes of the free memory"
        raise SettingError("num_envs", f"{wanted}, got {shown_value(count)}")
    return count


def free_memory() -> int:
    """Return the available memory [bytes], 2**63 if unknown."""
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
    except OSError:
        return 2**63
    (kilobytes,) = (int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    return 1024 * kilobytes


def _mode(given: AutoresetMode | str) -> AutoresetMode:
    """Return the mode of this name. Raises SettingError."""
    try:
        return AutoresetMode(given)
    except ValueError:
        names = ", ".join(mode.value for mode in AutoresetMode)
        problem = f"expected one of {names}, got {shown_value(given)}"
        raise SettingError("autoreset_mode", problem) from None
