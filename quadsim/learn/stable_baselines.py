"""Racing-v0 as a vector environment of stable-baselines3, 2.3 or later.

    from quadsim.learn.stable_baselines import RacingVecEnv
    PPO("MlpPolicy", RacingVecEnv(256, course="split_s_swift", start="anywhere")).learn(1_000_000)

Only this module imports stable-baselines3.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from quadsim.files.extras import needs_extra
from quadsim.learn.vector_env import RacingVectorEnv

try:
    from stable_baselines3.common.vec_env import VecEnv
except ModuleNotFoundError as error:
    if (error.name or "").partition(".")[0] != "stable_baselines3":
        raise
    line = needs_extra("stable-baselines3", "train")
    raise ModuleNotFoundError(line, name=error.name) from None


class RacingVecEnv(VecEnv):
    """Many races of one vehicle each, whose episodes restart in the step in which they end.

    If an episode has ended, its entry of `infos` holds Gymnasium's `passed`, `gates`, `lap`,
    `time`, `crashed` and `finished`, with `terminal_observation` and `TimeLimit.truncated`. All
    other entries are empty, as filling thousands of them takes time.

    Args:
        num_envs: number of vehicles.
        hold: steps of dt for which an action is held.
        settings: see RacingVectorEnv, without autoreset_mode.
    """

    def __init__(self, num_envs: int = 1, *, hold: int = 1, **settings: Any):
        self.hold = hold
        self.envs = RacingVectorEnv(num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **settings)
        self.render_mode = self.envs.render_mode
        observations = self.envs.single_observation_space
        actions = self.envs.single_action_space
        super().__init__(num_envs, observations, actions)
        self._actions: np.ndarray | None = None

    def reset(self) -> np.ndarray:
        """Start all episodes and return observations (num_envs, 38).

        The seed of the last call of `seed` is used for the next reset only.
        """
        seed = self._seeds[0]
        self._reset_seeds()
        self._reset_options()
        observations, _ = self.envs.reset(seed=seed)
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Store the actions for `step_wait`.  (num_envs, 4)"""
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict]]:
        """Simulate the steps of one action; return observations, summed rewards, dones, infos."""
        obs, rewards, done, infos = self._fly_step()
        for _ in range(self.hold - 1):
            obs, reward, ended, more = self._fly_step()
            # rewards after an end belong to the next episode
            rewards += np.where(done, 0.0, reward)
            for i in np.flatnonzero(ended & ~done):
                infos[i] = more[i]
            done |= ended
        return obs, rewards, done, infos

    def _fly_step(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict]]:
        """Simulate one step of dt; return observations, rewards, dones and infos."""
        obs, reward, ended, cut, info = self.envs.step(self._actions)
        done = ended | cut
        infos: list[dict] = [{} for _ in range(self.num_envs)]
        numbers = {name: values for name, values in info.items() if "final_obs" not in name}
        for i in np.flatnonzero(done):
            infos[i] = {name: values[i].item() for name, values in numbers.items()}
            infos[i]["terminal_observation"] = info["final_obs"][i]
            infos[i]["TimeLimit.truncated"] = bool(cut[i])
        return obs, reward, done, infos

    def close(self) -> None:
        """Close the viewer."""
        self.envs.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return one picture of all vehicles, or [None] if render_mode is not rgb_array."""
        return self.envs.render() or [None]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute once for each of the given environments."""
        owner = self.envs if hasattr(self.envs, attr_name) else self
        return [getattr(owner, attr_name)] * self._count(indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of all environments, which share their settings.

        Raises:
            ValueError: the indices select only some of the environments.
        """
        if self._count(indices) != self.num_envs:
            wanted = f"expected to be set for all {self.num_envs} environments at once"
            raise ValueError(f"{attr_name}: {wanted}")
        setattr(self.envs, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any
    ) -> list[Any]:
        """Call a method once for all environments, and return its result for each given one."""
        result = getattr(self.envs, method_name)(*args, **kwargs)
        return [result] * self._count(indices)

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """Return False for each of the given environments."""
        return [False] * self._count(indices)

    def _count(self, indices: Any) -> int:
        return len(list(self._get_indices(indices)))
