"""Samplers: where the perturbations eps of v = u + eps come from. One short file each, with its law.

All share one layout, (series, n_u, halves * T, LANES): LANES samples stand side by side, and one
series may hold several samples of T steps one after the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from controllers.samplers.colored import Colored
from controllers.samplers.gaussian import Gaussian


class Sampler(Protocol):
    """Perturbations for M samples of T steps, a function of (key, call) alone."""

    def sample(self, call: int) -> np.ndarray:
        """eps (series, n_u, halves * T, LANES); the buffer may be used again by the next call."""
        ...


@dataclass(frozen=True)
class SamplerConfig:
    """One standard deviation and one colour exponent per control channel."""

    sigma: tuple[float, ...] = (0.3, 0.3, 0.3, 3.5)  # units of the control channels
    gamma: tuple[float, ...] = (0.01, 0.01, 0.01, 0.5)  # PSD ~ 1/f^gamma; colored only
    law: str = "exact"  # exact | paper | library; colored only


def _gaussian(config: SamplerConfig, samples: int, horizon: int, key: np.ndarray) -> Sampler:
    return Gaussian(config.sigma, samples, horizon, key)


def _colored(config: SamplerConfig, samples: int, horizon: int, key: np.ndarray) -> Sampler:
    return Colored(config.sigma, config.gamma, config.law, samples, horizon, key)


SAMPLERS: dict[str, Callable[[SamplerConfig, int, int, np.ndarray], Sampler]] = {
    "gaussian": _gaussian,
    "colored": _colored,
}
