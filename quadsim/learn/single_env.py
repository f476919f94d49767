"""`quadsim/Racing-v0` for one vehicle: the same lanes, one of them in use."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.vector import AutoresetMode

from quadsim.learn.render import RENDER_MODES
from quadsim.learn.spaces import ACTIONS, action_space, checked_actions, observation_space
from quadsim.learn.vector_env import RacingVectorEnv


class RacingEnv(Env):
    """One race. Arguments as of RacingVectorEnv, without num_envs and autoreset_mode."""

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 100}  # noqa: RUF012

    def __init__(self, render_mode: str | None = None, **settings: Any):
        self._envs = RacingVectorEnv(
            1, autoreset_mode=AutoresetMode.DISABLED, render_mode=render_mode, **settings
        )
        self.task, self.render_mode = self._envs.task, render_mode
        self.observation_space, self.action_space = observation_space(), action_space()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        return self._envs.reset(seed=seed)[0][0], {}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One step of dt under an action (4,); see RacingVectorEnv.step."""
        chosen = checked_actions(action, (ACTIONS,))
        obs, reward, ended, cut, info = self._envs.step(chosen[None])
        one = {name: value[0].item() for name, value in info.items()}
        return obs[0], float(reward[0]), bool(ended[0]), bool(cut[0]), one

    def render(self) -> Any:
        """With rgb_array a picture from above.  (height, width, 3) uint8"""
        frames = self._envs.render()
        return frames if frames is None else frames[0]

    def close(self) -> None:
        self._envs.close()
