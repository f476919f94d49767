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

import numpy as np
from scipy.fft import irfft

from controllers.rollout.lanes import LANES
from controllers.rollout.normals import fill_normals
from controllers.rollout.threads import threads

LAWS = ("exact", "paper", "library")
OFFSET_DECAY = 0.97  # per step; law "library" only


def spectrum(n: int, gamma: float, law: str) -> np.ndarray:
    """Standard deviation of the real and imaginary part of each bin for unit variance.  (n // 2 + 1,)

    With s_k = max(k, 1)^(-gamma/2), irfft of independent parts has the variance
    (s_0^2 + 4 sum_{0<k<n/2} s_k^2 + s_{n/2}^2) / n^2; the last term for even n only.
    """
    k = np.maximum(np.arange(n // 2 + 1), 1.0)
    s = k ** (-gamma / 2)
    weight = np.full(len(s), 4.0)
    weight[0] = 0.0 if law == "library" else 1.0
    if n % 2 == 0:
        weight[-1] = 4.0 if law == "paper" else 1.0  # the published zeta counts the Nyquist bin as any other
    return s * n / np.sqrt(weight @ s**2)


class Colored:
    """z = irfft(Z), Z_k ~ N(0, s_k^2) + i N(0, s_k^2), per control channel."""

    def __init__(
        self,
        sigma: tuple[float, ...],
        gamma: tuple[float, ...],
        law: str,
        samples: int,
        horizon: int,
        key: np.ndarray,
    ):
        self._n = horizon if law == "paper" else 2 * horizon  # length of the transform
        self._steps = self._n if law == "exact" else horizon  # of it that are used
        self._held = 2 * LANES if law == "exact" else LANES  # samples in one series of lanes
        series = -(-samples // self._held)
        scale = [s * spectrum(self._n, g, law) for s, g in zip(sigma, gamma, strict=True)]
        self._scale = np.repeat(np.array(scale, np.float32).ravel(), 2)  # real and imaginary part alike
        self._bins = np.empty((series, len(sigma), self._n // 2 + 1, LANES), np.complex64)
        self._law, self._samples, self._horizon, self._key = law, samples, horizon, key

    def sample(self, call: int, samples: int | None = None) -> np.ndarray:
        bins = self._bins[: -(-(samples or self._samples) // self._held)]
        # a row of LANES complex bins is two rows of LANES equally scaled normals
        fill_normals(bins.view(np.float32).reshape(len(bins), -1, LANES), self._scale, self._key, call)
        # irfft ignores the imaginary parts of the DC and Nyquist bins, as a real signal must
        z = np.asarray(irfft(bins, n=self._n, axis=2, workers=threads()))
        return self._settled(z) if self._law == "library" else z

    def _settled(self, z: np.ndarray) -> np.ndarray:
        """z_t - z_1 .97^t over the first half of z, contiguous as the rollout wants it."""
        decay = np.float32(OFFSET_DECAY) ** np.arange(self._horizon, dtype=np.float32)
        settled = np.multiply(z[:, :, 1:2], -decay[:, None])
        settled += z[:, :, : self._horizon]
        return settled
