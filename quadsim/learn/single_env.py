"""`quadsim/Racing-v0` for one vehicle: the compiled lanes with one lane in use."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from quadsim.learn.render import RENDER_MODES, ViewerFactory
from quadsim.learn.spaces import (
    ACTIONS,
    action_space,
    checked_actions,
    checked_reset,
    observation_space,
)
from quadsim.learn.vector_env import RacingVectorEnv


class RacingEnv(Env):
    """A race of one vehicle, an environment of Gymnasium.

    Args:
        render_mode, viewer, settings: see RacingVectorEnv, without num_envs and autoreset_mode.

    Examples:
        >>> from quadsim.learn.single_env import RacingEnv
        >>> env = RacingEnv(course="figure8")
        >>> observation, info = env.reset(seed=0)
        >>> observation, reward, ended, cut, info = env.step(env.action_space.sample())
        >>> info["gates"]
        0
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 100}  # noqa: RUF012

    def __init__(
        self, render_mode: str | None = None, viewer: ViewerFactory | None = None, **settings: Any
    ):
        self._envs = RacingVectorEnv(
            1,
            autoreset_mode=AutoresetMode.DISABLED,
            render_mode=render_mode,
            viewer=viewer,
            **settings,
        )
        self._has_ended = False
        self.task = self._envs.task
        self.render_mode = render_mode
        self.observation_space = observation_space()
        self.action_space = action_space()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode and return its first observation (38,).

        Args:
            seed: seed of a new series of episodes, 0 to 2^63 - 1; None: the series continues.
            options: not used; wrappers may pass any.

        Raises:
            SettingError: the seed is not an integer, or out of range.
        """
        seed = checked_reset(seed, options)
        super().reset(seed=seed)
        observations, _ = self._envs.reset(seed=seed)
        self._has_ended = False
        return observations[0], {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Fly one step of dt under an action (4,); see RacingVectorEnv.step.

        Raises:
            ValueError: the action has a wrong shape, or is not finite.
            gymnasium.error.ResetNeeded: before the first reset, or after the episode has ended.
        """
        if self._has_ended:
            raise ResetNeeded("Racing-v0: the episode has ended: call reset()")
        chosen = checked_actions(action, (ACTIONS,))
        obs, reward, ended, cut, info = self._envs.step(chosen[None])
        of_one = {name: values[0].item() for name, values in info.items()}
        self._has_ended = bool(ended[0] or cut[0])
        return obs[0], float(reward[0]), bool(ended[0]), bool(cut[0]), of_one

    def render(self) -> np.ndarray | None:
        """Return a picture from above if the mode is rgb_array.  (height, width, 3) uint8"""
        pictures = self._envs.render()
        return None if pictures is None else pictures[0]

    def close(self) -> None:
        """Close the viewer."""
        self._envs.close()
