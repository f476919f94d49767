"""Colored sampling, PSD(f) ~ 1/f^gamma: Gaussians in the frequency domain, then an inverse FFT.

Timmer and Koenig 1995; Vlahov et al. 2024, section III-A and Algorithm 1. Three methods go by this
name:

exact    a transform of length n >= 2T whose steps 0..T-1 and T..2T-1 are two samples. The periodic
         wrap of the transform falls outside both, and the variance is sigma^2 at every t. The two
         are antithetic rather than independent: at one t they correlate by -.08, -.30, -.52 for
         gamma 1, 2, 4 and n = 2T. n is the first such length without a prime factor above 13; a
         large one would take many times as long.
paper    the published formula to the letter: length T (so z_0 and z_{T-1} are neighbours), divided
         by zeta = T^-2 N^gamma (1 + 4 sum_{n=1}^{N-1} n^-gamma).
library  the authors' public CUDA code: length 2T with the first half kept, normalised without the
         DC bin, and an offset z_t -= z_1 .97^t, so that every sample starts near zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np

from controllers.lanes.layout import LANES
from controllers.lanes.passes import fast_length
from controllers.samplers.lane_sampler import Gamma, LaneSampler, Sigma
from quadsim.files.strict_yaml import setting
from quadsim.files.values import SettingError, check_fields

Law = Literal["exact", "paper", "library"]
LAWS: tuple[Law, ...] = get_args(Law)
OFFSET_DECAY = 0.97  # per step; "library" only


def transform_length(horizon: int, law: Law) -> int:
    """Return the length n of a method's transform.

    For `exact` any length that holds two samples will do, so it is one whose transform is fast.
    """
    if law == "exact":
        return fast_length(2 * horizon)
    return horizon if law == "paper" else 2 * horizon


def spectrum(n: int, gamma: float, law: Law) -> np.ndarray:
    """Return the standard deviation s_k of the real and imaginary part of Z_k, for unit variance.

    z_t = sum_k Z_k e^{2 pi i k t / n} has two independent real parts of variance sum_k s_k^2. As a
    real transform has them, the power of frequency k/n is k^-gamma per real number. There are two
    such numbers for k and n - k together, real and imaginary part, but one for DC (k^-gamma taken
    as 1) and Nyquist, which are real.

    Args:
        n: length of the transform.
        gamma: exponent of the power spectral density.
        law: the method.

    Returns:
        (n,)
    """
    k = np.minimum(np.arange(n), n - np.arange(n))
    real = 2 * k % n == 0
    power = np.where(real, 1.0, 2.0) * np.maximum(k, 1.0) ** -gamma
    counted = power.copy()
    if law == "library":
        counted[0] = 0.0
    if law == "paper":
        # The published zeta counts the Nyquist bin as any other.
        counted[real & (k > 0)] *= 4.0
    return np.sqrt(power / counted.sum())


@dataclass(frozen=True)
class Colored:
    """v = u + sigma z, PSD(f) of z ~ 1/f^gamma, independent for every control; Vlahov et al. 2024.

    The methods are described in this module's docstring.

    Raises:
        SettingError: gamma and sigma have different lengths (a ValueError).

    Examples:
        >>> from quadsim import Colored
        >>> sampler = Colored(sigma=(0.2, 0.2, 0.2, 0.5), gamma=(0.01, 0.01, 0.01, 0.5))
        >>> sampler.gamma
        (0.01, 0.01, 0.01, 0.5)
    """

    sigma: Annotated[Sigma, setting("standard deviation of each control, in its unit")]
    gamma: Annotated[
        Gamma,
        setting("exponent of each control's power spectral density 1/f^gamma; 0: white"),
    ]
    law: Annotated[
        Law,
        setting(
            "spectrum: exact (no wrap-around), paper (as published) or library (the authors' code)"
        ),
    ] = "exact"

    def __post_init__(self) -> None:
        check_fields(self)
        if len(self.gamma) != len(self.sigma):
            wanted = f"expected {len(self.sigma)} numbers, as sigma has"
            raise SettingError("gamma", f"{wanted}, got {len(self.gamma)}")

    def build(self, samples: int, horizon: int, key: np.ndarray, dt: float) -> LaneSampler:
        """Return the source of perturbations, see Sampling."""
        # Imported here, as they load the compiler
        from controllers.lanes.transform import fill_transformed, transform_loop

        # Samples and time steps of one series
        halves = 2 if self.law == "exact" else 1
        held = halves * LANES
        steps = halves * horizon
        noise = np.empty((-(-samples // held), len(self.sigma), steps, LANES), np.float32)

        # Standard deviations of the real parts, and of the imaginary parts  (n_u, 2 n)
        n = transform_length(horizon, self.law)
        rows = []
        for sigma, gamma in zip(self.sigma, self.gamma, strict=True):
            rows.append(sigma * np.tile(spectrum(n, gamma, self.law), 2))
        scale = np.array(rows, np.float32)

        # The share of the second step that is taken off each step
        decay = np.zeros(steps)
        if self.law == "library":
            decay = OFFSET_DECAY ** np.arange(steps)
        offset = decay.astype(np.float32)

        def sample(call: int, first: int = 0, samples: int = samples) -> np.ndarray:
            z = noise[: -(-samples // held)]
            fill_transformed(z, scale, offset, key, call, first // held // 2)
            return z

        return LaneSampler(sample, transform_loop(n))
