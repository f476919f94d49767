"""Racing-v0 as a vector environment of stable-baselines3 (2.3 or later), which this module alone
imports.

from quadsim.learn.stable_baselines import RacingVecEnv
PPO("MlpPolicy", RacingVecEnv(256, course="split_s_swift", start="anywhere")).learn(1_000_000)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv

from quadsim.learn.vector_env import RacingVectorEnv


class RacingVecEnv(VecEnv):
    """Arguments as of RacingVectorEnv, without autoreset_mode: episodes start anew in the same
    step.

    `infos` hold Gymnasium's `passed`, `gates`, `lap`, `time`, `crashed`, `finished` where an
    episode has ended, with `terminal_observation` and `TimeLimit.truncated`; elsewhere they are
    empty, as making thousands takes time.
    """

    def __init__(self, num_envs: int = 1, **settings: Any):
        self.envs = RacingVectorEnv(num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **settings)
        self.render_mode = self.envs.render_mode
        super().__init__(
            num_envs, self.envs.single_observation_space, self.envs.single_action_space
        )
        self._actions: np.ndarray | None = None

    def reset(self) -> np.ndarray:
        """Observations (num_envs, 38); the seed is that of the last `seed`, for one reset."""
        seed = self._seeds[0]
        self._reset_seeds()
        self._reset_options()
        return self.envs.reset(seed=seed)[0]

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict]]:
        obs, reward, ended, cut, told = self.envs.step(self._actions)
        done = ended | cut
        infos: list[dict] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done):
            infos[i] = {
                name: values[i].item()
                for name, values in told.items()
                if values.ndim == 1 and name[0] != "_"
            }
            infos[i] |= {
                "terminal_observation": told["final_obs"][i],
                "TimeLimit.truncated": bool(cut[i]),
            }
        return obs, reward, done, infos

    def close(self) -> None:
        self.envs.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        return self.envs.render() or [None]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [
            getattr(self.envs if hasattr(self.envs, attr_name) else self, attr_name)
        ] * self._count(indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Raises ValueError unless for all environments: they share their settings."""
        if self._count(indices) != self.num_envs:
            raise ValueError(
                f"{attr_name}: expected to be set for all {self.num_envs} environments at once"
            )
        setattr(self.envs, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Called once, for all environments."""
        return [getattr(self.envs, method_name)(*args, **kwargs)] * self._count(indices)

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        return [False] * self._count(indices)

    def _count(self, indices: Any) -> int:
        return len(list(self._get_indices(indices)))
