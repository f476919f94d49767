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

from controllers.rollout.normals import fill_normals
from controllers.samplers.colored import Colored
from controllers.samplers.gaussian import Gaussian
from controllers.samplers.log_normal import LogNormal
from controllers.samplers.smooth import Momentum
from quadsim.files.strict_yaml import unit

Sigma = Annotated[float, Meta(gt=0, le=1000)]
Gamma = Annotated[float, Meta(ge=0, le=10)]
Sigmas = Annotated[tuple[Sigma, Sigma, Sigma, Sigma], unit("rad/s, rad/s, rad/s, m/s^2")]


class Sample(Protocol):
    """Perturbations of T steps, a function of (key, call, number of the sample) alone."""

    def __call__(self, call: int, first: int = 0, samples: int | None = None) -> np.ndarray:
        """eps (series, n_u, halves * T, LANES) of the samples from `first` on, a multiple of 4 LANES.

        As many as the buffer holds, or fewer; it is used again by the next call.
        """
        ...


@dataclass(frozen=True)
class Sampler:
    """What MPPI draws from: perturbations of its plan, or of its plan and the momentum that this has."""

    sample: Sample
    loop: Callable  # the compiled one behind it
    momentum: Momentum | None = None


class Sampling(Protocol):
    """The numbers of a sampler, one of sigma and gamma per control channel."""

    @property
    def sigma(self) -> tuple[float, ...]: ...
    @property
    def gamma(self) -> tuple[float, ...]: ...
    @property
    def law(self) -> str: ...
    @property
    def shift(self) -> str: ...


@dataclass(frozen=True)
class Channels:
    """Sampling for any system."""

    sigma: tuple[float, ...]
    gamma: tuple[float, ...]
    law: str = "exact"
    shift: str = "corrected"


@dataclass(frozen=True)
class SamplerConfig:
    """Sampling for the quadrotor, as files and flags say it: one sigma and one gamma per control channel."""

    sigma: Sigmas = (0.3, 0.3, 0.3, 3.5)  # standard deviation of body rates [rad/s] and thrust [m/s^2]
    gamma: tuple[Gamma, Gamma, Gamma, Gamma] = (0.01, 0.01, 0.01, 0.5)  # PSD ~ 1/f^gamma; colored only
    law: Literal["exact", "paper", "library"] = "exact"  # of the colored noise; colored only
    shift: Literal["corrected", "published"] = "corrected"  # of the momentum with time; smooth and smooth_star only


def _gaussian(config: Sampling, samples: int, horizon: int, key: np.ndarray, dt: float) -> Sampler:
    return Sampler(Gaussian(config.sigma, samples, horizon, key).sample, fill_normals)


def _colored(config: Sampling, samples: int, horizon: int, key: np.ndarray, dt: float) -> Sampler:
    noise = Colored(config.sigma, config.gamma, config.law, samples, horizon, key)
    return Sampler(noise.sample, noise.loop)


def _log_normal(config: Sampling, samples: int, horizon: int, key: np.ndarray, dt: float) -> Sampler:
    return Sampler(LogNormal(config.sigma, samples, horizon, key).sample, fill_normals)


def _smooth(config: Sampling, samples: int, horizon: int, key: np.ndarray, dt: float) -> Sampler:
    slow = Channels(tuple(s * dt for s in config.sigma), config.gamma, config.law, config.shift)
    return _smooth_star(slow, samples, horizon, key, dt)


def _smooth_star(config: Sampling, samples: int, horizon: int, key: np.ndarray, dt: float) -> Sampler:
    noise = Gaussian(config.sigma, samples, horizon, key)
    return Sampler(noise.sample, fill_normals, Momentum(horizon, len(config.sigma), config.shift))


# name -> sampler of (config, samples, horizon, key, control period [s])
SAMPLERS: dict[str, Callable[[Sampling, int, int, np.ndarray, float], Sampler]] = {
    "gaussian": _gaussian,
    "colored": _colored,
    "log_normal": _log_normal,
    "smooth": _smooth,
    "smooth_star": _smooth_star,
}
