"""White Gaussian sampling: eps_t ~ N(0, sigma^2), independent over t. The default of MPPI (Williams et al. 2018)."""

from __future__ import annotations

import numpy as np

from controllers.rollout.lanes import LANES
from controllers.rollout.normals import fill_normals


class Gaussian:
    """v = u + sigma xi, xi ~ N(0, 1)."""

    def __init__(self, sigma: tuple[float, ...], samples: int, horizon: int, key: np.ndarray):
        self._noise = np.empty((-(-samples // LANES), len(sigma), horizon, LANES), np.float32)
        self._scale = np.repeat(np.array(sigma, np.float32), horizon)  # (n_u * T,)
        self._samples, self._key = samples, key

    def sample(self, call: int, first: int = 0, samples: int | None = None) -> np.ndarray:
        noise = self._noise[: -(-(samples or self._samples) // LANES)]
        fill_normals(noise.reshape(len(noise), -1, LANES), self._scale, self._key, call, first // LANES)
        return noise
