"""Racing-v0 in PyTorch tensors, which this module alone imports: on the CPU they share the arrays'
memory, no copy.

from quadsim.learn.tensors import RacingTensors
envs = RacingTensors(4096, course="split_s_swift", start="anywhere")
obs = envs.reset(seed=0)
obs, reward, terminated, truncated, info = envs.step(torch.zeros(4096, 4))
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode

from quadsim.learn.vector_env import RacingVectorEnv

Step = tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, dict[str, Any]]


class RacingTensors:
    """Arguments as of RacingVectorEnv; episodes start anew in the same step unless autoreset_mode
    says otherwise.

    device: to which every step moves its results; None: they stay where they are, on the CPU.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        device: torch.device | str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        **settings: Any,
    ):
        self.envs = RacingVectorEnv(num_envs, autoreset_mode=autoreset_mode, **settings)
        self.device = torch.device(device or "cpu")

    def reset(self, *, seed: int | None = None) -> torch.Tensor:
        """Observations (num_envs, 38)."""
        return self._tensor(self.envs.reset(seed=seed)[0])

    def step(self, actions: torch.Tensor) -> Step:
        """See RacingVectorEnv.step: tensors in place of arrays, in info too."""
        *found, info = self.envs.step(actions.detach().cpu().numpy())
        obs, reward, terminated, truncated = map(self._tensor, found)
        return (
            obs,
            reward,
            terminated,
            truncated,
            {name: self._tensor(values) for name, values in info.items()},
        )

    def _tensor(self, values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(values).to(self.device)
