"""Log-MPPI (Mohamed et al. 2022): the product of a normal and a log-normal, white like the Gaussian but with
heavy tails.

    z = sigma xi exp(sigma eta),  xi, eta ~ N(0, 1) independent for every sample, time and channel

Its standard deviation is sigma exp(sigma^2), its kurtosis 3 exp(4 sigma^2).
"""

from __future__ import annotations

import numpy as np

from controllers.rollout.lanes import LANES
from controllers.rollout.normals import fill_normals

CEILING = np.float32(60.0)  # of the exponent: exp(60) is far beyond any control and far below float32's end


class LogNormal:
    """v = u + sigma xi exp(sigma eta)."""

    def __init__(self, sigma: tuple[float, ...], samples: int, horizon: int, key: np.ndarray):
        blocks = -(-samples // LANES)
        self._normals = np.empty((blocks, 2, len(sigma), horizon, LANES), np.float32)  # sigma xi, sigma eta
        self._noise = np.empty((blocks, len(sigma), horizon, LANES), np.float32)
        self._scale = np.tile(np.repeat(np.array(sigma, np.float32), horizon), 2)  # (2 * n_u * T,)
        self._samples, self._key = samples, key

    def sample(self, call: int, first: int = 0, samples: int | None = None) -> np.ndarray:
        blocks = -(-(samples or self._samples) // LANES)
        normals, noise = self._normals[:blocks], self._noise[:blocks]
        fill_normals(normals.reshape(blocks, -1, LANES), self._scale, self._key, call, first // LANES)
        np.minimum(normals[:, 1], CEILING, out=noise)
        np.exp(noise, out=noise)
        return np.multiply(noise, normals[:, 0], out=noise)
