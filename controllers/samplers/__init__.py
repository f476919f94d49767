"""Samplers: where the perturbations eps of v = u + eps come from. One short file each, with its law.

All share one layout, (series, n_u, halves * T, LANES): LANES samples stand side by side, and one
series may hold several samples of T steps one after the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol

import numpy as np
from msgspec import Meta

from controllers.samplers.colored import Colored
from controllers.samplers.gaussian import Gaussian
from quadsim.strict_yaml import unit

Sigma = Annotated[float, Meta(gt=0, le=1000)]
Gamma = Annotated[float, Meta(ge=0, le=10)]
Sigmas = Annotated[tuple[Sigma, Sigma, Sigma, Sigma], unit("rad/s, rad/s, rad/s, m/s^2")]


class Sampler(Protocol):
    """Perturbations for M samples of T steps, a function of (key, call) alone."""

    def sample(self, call: int, samples: int | None = None) -> np.ndarray:
        """eps (series, n_u, halves * T, LANES) of the first `samples`, or of all.

        The buffer is used again by the next call.
        """
        ...


@dataclass(frozen=True)
class SamplerConfig:
    """One standard deviation and one colour exponent per control channel."""

    sigma: Sigmas = (0.3, 0.3, 0.3, 3.5)  # standard deviation of body rates [rad/s] and thrust [m/s^2]
    gamma: tuple[Gamma, Gamma, Gamma, Gamma] = (0.01, 0.01, 0.01, 0.5)  # PSD ~ 1/f^gamma; colored only
    law: Literal["exact", "paper", "library"] = "exact"  # of the colored noise; colored only


def _gaussian(config: SamplerConfig, samples: int, horizon: int, key: np.ndarray) -> Sampler:
    return Gaussian(config.sigma, samples, horizon, key)


def _colored(config: SamplerConfig, samples: int, horizon: int, key: np.ndarray) -> Sampler:
    return Colored(config.sigma, config.gamma, config.law, samples, horizon, key)


SAMPLERS: dict[str, Callable[[SamplerConfig, int, int, np.ndarray], Sampler]] = {
    "gaussian": _gaussian,
    "colored": _colored,
}
