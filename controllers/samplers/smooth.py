"""Smooth-MPPI (Kim et al. 2022): noise on the derivative of the controls.

    d = D + sigma xi        sampled derivatives around the derivative plan D, xi ~ N(0, 1)
    v = U + d dt            sampled controls: no sum over t, so v is as white as Gaussian sampling's
    D <- sum_m w^m d^m      U <- U + D dt

D dt is the change of the plan U in the last iteration, and sampling is centred on U plus this
change. Smooth-MPPI is therefore Gaussian sampling with sigma dt and a momentum. Smooth-MPPI*
(Vlahov et al. 2024, section IV-C) is the same with sigma / dt. From one period to the next, D is
shifted with the plan (`corrected`). In the authors' public CUDA code, on which the paper's tables
are based, an error replaces every derivative by the one at index 1 (`published`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from quadsim.controllers.samplers.gaussian import Gaussian
from quadsim.controllers.samplers.lane_sampler import LaneSampler, Momentum, Shift, Sigma
from quadsim.files.strict_yaml import setting
from quadsim.files.values import check_fields


@dataclass(frozen=True)
class SmoothStar:
    """Smooth-MPPI* (Vlahov et al. 2024), with sigma in the units of the controls.

    Examples:
        >>> from quadsim import SmoothStar
        >>> sampler = SmoothStar(sigma=(0.06, 0.06, 0.06, 0.7))
    """

    sigma: Annotated[Sigma, setting("standard deviation of each control, in its unit")]
    shift: Annotated[Shift, setting("shift of the momentum with time")] = "corrected"

    def __post_init__(self) -> None:
        check_fields(self)

    def build(
        self, samples: int, lengths: Sequence[int], key: np.ndarray, dt: float
    ) -> LaneSampler:
        """Return the source of perturbations, see Sampling."""
        momentum = Momentum(sum(lengths), len(self.sigma), self.shift)
        return replace(Gaussian(self.sigma).build(samples, lengths, key, dt), momentum=momentum)


@dataclass(frozen=True)
class Smooth:
    """Smooth-MPPI (Kim et al. 2022), with sigma in the units of the controls' derivatives.

    Examples:
        >>> from quadsim import Smooth
        >>> sampler = Smooth(sigma=(6.0, 6.0, 6.0, 70.0))  # [rad/s^2, rad/s^2, rad/s^2, m/s^3]
    """

    sigma: Annotated[
        Sigma, setting("standard deviation of each control's derivative, in its unit per second")
    ]
    shift: Annotated[Shift, setting("shift of the momentum with time")] = "corrected"

    def __post_init__(self) -> None:
        check_fields(self)

    def build(
        self, samples: int, lengths: Sequence[int], key: np.ndarray, dt: float
    ) -> LaneSampler:
        """Return the source of perturbations, see Sampling."""
        sigma = tuple(s * dt for s in self.sigma)
        return SmoothStar(sigma, self.shift).build(samples, lengths, key, dt)
