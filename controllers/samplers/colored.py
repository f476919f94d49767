"""Colored sampling, PSD(f) ~ 1/f^gamma: independent Gaussians in the frequency domain, then an
inverse FFT.

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

Law = Literal["exact", "paper", "library"]
LAWS: tuple[Law, ...] = get_args(Law)
OFFSET_DECAY = 0.97  # per step; "library" only


def transform_length(horizon: int, law: Law) -> int:
    """n of the method: for `exact` any length that holds two samples will do, so one whose
    transform is fast."""
    return {"exact": fast_length(2 * horizon), "paper": horizon, "library": 2 * horizon}[law]


def spectrum(n: int, gamma: float, law: Law) -> np.ndarray:
    """Standard deviation of the real and of the imaginary part of Z_k, for unit variance of z.
    (n,)

    z_t = sum_k Z_k e^{2 pi i k t / n} has two independent real parts of variance sum_k s_k^2. As a
    real transform has them, the power of frequency k/n is k^-gamma per real number: two for k and n
    - k together, real and imaginary part, but one for DC (k^-gamma taken as 1) and Nyquist, which
      are real.
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


@dataclass(frozen=True)
class Colored:
    """v = u + sigma z, PSD(f) of z ~ 1/f^gamma, independent for every control; Vlahov et al. 2024.

    sigma (n_u,) in the units of the controls, gamma (n_u,), 0: white. The methods: see this
    module's docstring. Raises ValueError where gamma and sigma have different lengths.
    """

    sigma: Annotated[Sigma, setting("standard deviation of each control, in its unit")]
    gamma: Annotated[
        Gamma, setting("exponent of each control, power spectral density ~ 1/f^gamma; 0: white")
    ]
    law: Annotated[
        Law,
        setting(
            "spectrum: exact (no wrap-around), paper (as published), library (the authors' public code)"
        ),
    ] = "exact"

    def __post_init__(self) -> None:
        if len(self.gamma) != len(self.sigma):
            raise ValueError(
                f"gamma: expected {len(self.sigma)} numbers, as sigma has, got {len(self.gamma)}"
            )

    def build(self, samples: int, horizon: int, key: np.ndarray, dt: float) -> LaneSampler:
        # here: they load the compiler
        from controllers.lanes.transform import fill_transformed, transform_loop

        n, halves = transform_length(horizon, self.law), 2 if self.law == "exact" else 1
        held, steps = halves * LANES, halves * horizon  # samples and time steps of one series
        noise = np.empty((-(-samples // held), len(self.sigma), steps, LANES), np.float32)
        channels = zip(self.sigma, self.gamma, strict=True)
        # (n_u, 2 n): real parts, imaginary parts
        scale = np.array(
            [s * np.tile(spectrum(n, g, self.law), 2) for s, g in channels], np.float32
        )
        decay = OFFSET_DECAY ** np.arange(steps) if self.law == "library" else np.zeros(steps)
        offset = decay.astype(np.float32)

        def sample(call: int, first: int = 0, samples: int = samples) -> np.ndarray:
            z = noise[: -(-samples // held)]
            fill_transformed(z, scale, offset, key, call, first // held // 2)
            return z

        return LaneSampler(sample, transform_loop(n))
