"""Colored sampling, PSD(f) ~ 1/f^gamma: independent Gaussians in the frequency domain, then an inverse FFT.

Timmer and Koenig 1995; Vlahov et al. 2024, section III-A and Algorithm 1. Three laws go by this name:

exact    a transform of length 2T whose halves are two samples of length T. The periodic wrap of the
         transform falls outside both, and the variance is sigma^2 at every t. The two are antithetic
         rather than independent: at one t they correlate by -.08, -.30, -.52 for gamma 1, 2, 4.
paper    the published formula to the letter: length T (so z_0 and z_{T-1} are neighbours), divided by
         zeta = T^-2 N^gamma (1 + 4 sum_{n=1}^{N-1} n^-gamma).
library  the authors' public CUDA code: length 2T with the first half kept, normalised without the DC
         bin, and an offset z_t -= z_1 .97^t, so that every sample starts near zero.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from controllers.rollout.lanes import LANES
from controllers.rollout.transform import fill_transformed, transform_loop

LAWS = ("exact", "paper", "library")
OFFSET_DECAY = 0.97  # per step; law "library" only


def spectrum(n: int, gamma: float, law: str) -> np.ndarray:
    """Standard deviation of the real and of the imaginary part of Z_k, for unit variance of z.  (n,)

    z_t = sum_k Z_k e^{2 pi i k t / n} has two independent real parts of variance sum_k s_k^2. As a real
    transform has them, the power of frequency k/n is k^-gamma per real number: two for k and n - k together,
    real and imaginary part, but one for DC (k^-gamma taken as 1) and Nyquist, which are real.
    """
    k = np.minimum(np.arange(n), n - np.arange(n))
    real = 2 * k % n == 0
    power = np.where(real, 1.0, 2.0) * np.maximum(k, 1.0) ** -gamma
    counted = power.copy()
    if law == "library":
        counted[0] = 0.0
    if law == "paper":
        counted[real & (k > 0)] *= 4.0  # the published zeta counts the Nyquist bin as any other
    return np.sqrt(power / counted.sum())


class Colored:
    """v = u + sigma z, z of the law, independent for every control channel."""

    def __init__(
        self,
        sigma: tuple[float, ...],
        gamma: tuple[float, ...],
        law: str,
        samples: int,
        horizon: int,
        key: np.ndarray,
    ):
        n = horizon if law == "paper" else 2 * horizon  # length of the transform
        steps = n if law == "exact" else horizon  # of it that are used
        self._held = 2 * LANES if law == "exact" else LANES  # samples in one series of lanes
        self._noise = np.empty((-(-samples // self._held), len(sigma), steps, LANES), np.float32)
        scale = [s * np.tile(spectrum(n, g, law), 2) for s, g in zip(sigma, gamma, strict=True)]
        self._scale = np.array(scale, np.float32)  # (n_u, 2 n): real parts, imaginary parts
        decay = OFFSET_DECAY ** np.arange(steps) if law == "library" else np.zeros(steps)
        self._offset, self._samples, self._key = decay.astype(np.float32), samples, key

    @property
    def loop(self) -> Callable:
        return transform_loop(self._scale.shape[1] // 2)

    def sample(self, call: int, first: int = 0, samples: int | None = None) -> np.ndarray:
        z = self._noise[: -(-(samples or self._samples) // self._held)]
        fill_transformed(z, self._scale, self._offset, self._key, call, first // self._held // 2)
        return z
