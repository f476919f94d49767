"""Colored sampling, PSD(f) ~ 1/f^gamma: Gaussians in the frequency domain, then an inverse FFT.

References are Timmer and Koenig 1995, and Vlahov et al. 2024, section III-A and Algorithm 1. There
are three methods:

exact    a transform of length n >= 2T whose steps 0..T-1 and T..2T-1 are two samples. The periodic
         wrap of the transform falls outside both, and the variance is sigma^2 at every t. The two
         are antithetic rather than independent: at one t they correlate by -.08, -.30, -.52 for
         gamma 1, 2, 4 and n = 2T. n is the smallest such length without a prime factor above 13,
         because a large prime factor would take many times as long.
paper    the published formula exactly: length T (so z_0 and z_{T-1} are neighbours), divided
         by zeta = T^-2 N^gamma (1 + 4 sum_{n=1}^{N-1} n^-gamma).
library  the authors' public CUDA code: length 2T with the first half kept, normalised without the
         DC bin, and an offset z_t -= z_1 .97^t, so that every sample starts near zero.

With a cut-off f_c, the noise of `exact` is band-limited: its amplitudes are multiplied by
1 / (1 + (f / f_c)^4), and are zero above 3.15 f_c, at which this factor is 1 %. This lowers the
variance below sigma^2. With gamma 0 the noise is low-pass Gaussian. Most frequencies that are zero
are not drawn, because the transform starts from the others.

Steps of a rollout that are longer than a control period take the mean of the noise over the step.
The noise is then drawn at every r-th period only, if it has a cut-off, see
quadsim.controllers.lanes.sums. Fewer frequencies are drawn: those with a factor below 7 %, which
have less than a thousandth of the variance, are zero, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np

from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.passes import fast_length, frequencies, narrowest_band
from quadsim.controllers.lanes.sums import NO_SUMS, sums_of_steps
from quadsim.controllers.samplers.lane_sampler import Cutoff, Gamma, LaneSampler, Sigma
from quadsim.controllers.steps import Steps
from quadsim.files.strict_yaml import setting
from quadsim.files.values import SettingError, check_fields

Law = Literal["exact", "paper", "library"]
LAWS: tuple[Law, ...] = get_args(Law)
OFFSET_DECAY = 0.97  # factor per step; "library" only
# Factor on amplitudes below which the frequencies above a cut-off are left out, for steps of one
# control period and for longer ones
NEGLIGIBLE = 0.01
NEGLIGIBLE_LONGER = 0.07


def transform_length(horizon: int, law: Law) -> int:
    """Return the length n of a method's transform.

    For `exact` any length that holds two samples is valid, so a fast length is chosen.
    """
    if law == "exact":
        return fast_length(2 * horizon)
    return horizon if law == "paper" else 2 * horizon


def spectrum(n: int, gamma: float, law: Law) -> np.ndarray:
    """Return the standard deviation s_k of the real and imaginary part of Z_k, for unit variance.

    z_t = sum_k Z_k e^{2 pi i k t / n} has an independent real and imaginary part, each of variance
    sum_k s_k^2. As in a real transform, the power of frequency k/n is k^-gamma per real number. The
    pair k and n - k has two such numbers, real and imaginary part; DC (with k^-gamma taken as 1)
    and Nyquist have one, as they are real.

    Args:
        n: length of the transform.
        gamma: exponent of the power spectral density.
        law: the method.

    Returns:
        The standard deviations  (n,).
    """
    k = np.minimum(np.arange(n), n - np.arange(n))
    real = 2 * k % n == 0
    power = np.where(real, 1.0, 2.0) * np.maximum(k, 1.0) ** -gamma
    counted = power.copy()
    if law == "library":
        counted[0] = 0.0
    if law == "paper":
        # The published zeta treats the Nyquist bin like all other bins.
        counted[real & (k > 0)] *= 4.0
    return np.sqrt(power / counted.sum())


def roll_off(n: int, dt: float, cutoff: float, least: float = NEGLIGIBLE) -> np.ndarray:
    """Return the factors 1 / (1 + (f / f_c)^4) on amplitudes.

    Args:
        n: length of the transform.
        dt: control period [s].
        cutoff: cut-off frequency f_c [Hz].
        least: factor below which a factor is zero.

    Returns:
        The factors  (n,).
    """
    k = np.minimum(np.arange(n), n - np.arange(n))
    f = k / (n * dt)  # [Hz]
    factors = 1 / (1 + (f / cutoff) ** 4)
    return np.where(factors < least, 0.0, factors)


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
        setting(
            "exponent of each control's power spectral density 1/f^gamma; 0: white below the"
            " cut-off"
        ),
    ]
    law: Annotated[
        Law,
        setting(
            "spectrum: exact (no wrap-around), paper (as published) or library (the authors' code)"
        ),
    ] = "exact"
    cutoff: Annotated[
        Cutoff | None,
        setting(
            "frequency of each control above which amplitudes fall, by 1 / (1 + (f / f_c)^4); sigma"
            " is that without it; 0 or none: no cut-off",
            unit="Hz",
        ),
    ] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        cutoff = self.cutoff or ()
        object.__setattr__(self, "cutoff", cutoff)
        if any(cutoff) and self.law != "exact":
            raise SettingError("cutoff", f"expected none with the law {self.law}, which has none")
        if cutoff and len(cutoff) != len(self.sigma):
            wanted = f"expected {len(self.sigma)} frequencies [Hz], as many as sigma has"
            raise SettingError("cutoff", f"{wanted}, got {len(cutoff)}")
        if len(self.gamma) != len(self.sigma):
            wanted = f"expected {len(self.sigma)} numbers, as sigma has"
            raise SettingError("gamma", f"{wanted}, got {len(self.gamma)}")

    def build(
        self, samples: int, lengths: Sequence[int], key: np.ndarray, dt: float
    ) -> LaneSampler:
        """Return the source of perturbations, see Sampling."""
        noise = ColoredNoise(self, samples, lengths, key, dt)
        return LaneSampler(noise.draw, noise.loop, normals=noise.normals)


class ColoredNoise:
    """The perturbations z of one planner, drawn into the same memory at each call.

    A series is one transform with `halves` samples for each of the LANES lanes: with the method
    `exact` the first half of its control periods is one sample and the second half another one.

    Args:
        sampler: parameters of the noise.
        samples: largest number of samples drawn at a time.
        lengths: number of control periods of each step of the rollouts  (T,).
        key: key of the random numbers  (2,) uint32.
        dt: control period [s].
    """

    def __init__(
        self, sampler: Colored, samples: int, lengths: Sequence[int], key: np.ndarray, dt: float
    ):
        # Imported here, as they load the compiler
        from quadsim.controllers.lanes.transform import fill_transformed, transform_loop

        of_sample = Steps(lengths)
        n = transform_length(of_sample.periods, sampler.law)
        self._fill = fill_transformed
        self._key = key
        self._samples = samples

        # Samples and steps of a series
        halves = 2 if sampler.law == "exact" else 1
        self._held = halves * LANES
        steps = halves * of_sample.number

        # Standard deviations of real and imaginary parts, for each control  (n_u, n)
        least = NEGLIGIBLE_LONGER if of_sample.are_longer else NEGLIGIBLE
        cutoffs = [f or np.inf for f in sampler.cutoff or (0.0,) * len(sampler.sigma)]
        deviations = np.array(
            [
                sigma * spectrum(n, gamma, sampler.law) * roll_off(n, dt, cutoff, least)
                for sigma, gamma, cutoff in zip(sampler.sigma, sampler.gamma, cutoffs, strict=True)
            ]
        )

        # The drawn frequencies: the narrowest band that contains all nonzero amplitudes
        highest = int(np.flatnonzero(deviations[:, : n // 2 + 1].any(axis=0)).max(initial=0))
        band = narrowest_band(n, highest)
        self.normals = band / n * of_sample.periods / of_sample.number
        drawn = deviations[:, frequencies(band)]
        self._scale = np.tile(drawn, 2).astype(np.float32)  # (n_u, 2 B)

        # Longer steps need the series at every (n / B)-th period only.
        self._length, self._sums = n, NO_SUMS
        if of_sample.are_longer:
            self._length = band
            self._sums = sums_of_steps(deviations**2, of_sample, halves, n // band)
        self.loop = transform_loop(self._length, band, self._sums.terms)

        # The share of z_1 that is subtracted from each step  (steps,)
        self._offset = np.zeros(steps, np.float32)
        if sampler.law == "library":
            decay = OFFSET_DECAY ** np.arange(of_sample.periods)
            self._offset = of_sample.mean(decay[:, None]).ravel().astype(np.float32)

        shape = (self._series(samples), len(sampler.sigma), steps, LANES)
        self._z = np.empty(shape, np.float32)

    def draw(self, call: int, first: int = 0, samples: int | None = None) -> np.ndarray:
        """Return the perturbations of some samples, see LaneSampler.sample.

        Args:
            call: index of the call, which seeds the numbers.
            first: number of the first sample, a multiple of 4 LANES.
            samples: number of samples; None: the largest number.

        Returns:
            The perturbations  (series, n_u, halves * T, LANES).
        """
        z = self._z[: self._series(self._samples if samples is None else samples)]
        # Two series come from one transform.
        first_transform = first // self._held // 2
        self._fill(
            z, self._scale, self._offset, self._key, call, first_transform, self._length, self._sums
        )
        return z

    def _series(self, samples: int) -> int:
        """Return the number of series (transforms) that hold a number of samples."""
        return -(-samples // self._held)
