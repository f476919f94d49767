"""Samplers: distributions of the perturbations z of v = u + z, one short file each.

A sampler is a frozen dataclass of its numbers; `build` makes the source of perturbations that MPPI
draws from.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from controllers.samplers.colored import Colored
from controllers.samplers.gaussian import Gaussian
from controllers.samplers.lane_sampler import LaneSampler, Sampling
from controllers.samplers.log_normal import LogNormal
from controllers.samplers.plain import PlainSampler, lanes_of
from controllers.samplers.smooth import Smooth, SmoothStar

SAMPLERS: dict[str, type[Sampling]] = {
    "gaussian": Gaussian,
    "colored": Colored,
    "log_normal": LogNormal,
    "smooth": Smooth,
    "smooth_star": SmoothStar,
}


def make_sampler(name: str, **numbers: Any) -> Sampling:
    """The registered sampler of this name with those of the numbers that it has."""
    return SAMPLERS[name](
        **{f.name: numbers[f.name] for f in fields(SAMPLERS[name]) if f.name in numbers}
    )


def build_lanes(
    sampler: Sampling | PlainSampler,
    controls: int,
    samples: int,
    horizon: int,
    key: np.ndarray,
    dt: float,
) -> LaneSampler:
    """The source of perturbations of so many controls. Raises ValueError where the sampler has
    other numbers."""
    if not isinstance(sampler, Sampling):
        return lanes_of(sampler, samples, horizon, controls, key)
    if len(sampler.sigma) != controls:
        raise ValueError(
            f"sigma: expected {controls} numbers, one per control, got {len(sampler.sigma)}"
        )
    return sampler.build(samples, horizon, key, dt)
