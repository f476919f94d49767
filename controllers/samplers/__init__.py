"""Samplers: distributions of the perturbations z of v = u + z, each in its own file.

A sampler is a frozen dataclass of its parameters. Its method `build` returns the source of
perturbations for MPPI.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from quadsim.controllers.samplers.colored import Colored
from quadsim.controllers.samplers.gaussian import Gaussian
from quadsim.controllers.samplers.lane_sampler import LaneSampler, Sampling
from quadsim.controllers.samplers.log_normal import LogNormal
from quadsim.controllers.samplers.plain import PlainSampler, lanes_of
from quadsim.controllers.samplers.smooth import Smooth, SmoothStar
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value

SAMPLERS: dict[str, type[Sampling]] = {
    "gaussian": Gaussian,
    "colored": Colored,
    "log_normal": LogNormal,
    "smooth": Smooth,
    "smooth_star": SmoothStar,
}


def is_registered(sampler: object) -> bool:
    """Return whether a sampler is one of SAMPLERS rather than a user's own."""
    return type(sampler) in SAMPLERS.values()


def sampler_name(sampler: object) -> str:
    """Return the name of a registered sampler, or the class name of a user's own."""
    names = {kind: name for name, kind in SAMPLERS.items()}
    return names.get(cast(Any, type(sampler)), type(sampler).__name__)


def build_lanes(
    sampler: Sampling | PlainSampler,
    controls: int,
    samples: int,
    lengths: Sequence[int],
    key: np.ndarray,
    dt: float,
) -> LaneSampler:
    """Return the source of perturbations for MPPI.

    Args:
        sampler: a registered sampler, or an object with `sample`.
        controls: n_u, number of controls.
        samples: largest number of samples drawn at a time.
        lengths: number of control periods of each step of the rollouts  (T,).
        key: key of the random numbers  (2,) uint32.
        dt: control period [s].

    Raises:
        SettingError: there is no such sampler, or its number of controls differs (a ValueError).
    """
    if not isinstance(sampler, Sampling):
        if isinstance(sampler, type) or not callable(getattr(sampler, "sample", None)):
            wanted = "expected an object with sample(rng, samples, horizon, controls)"
            raise SettingError("sampler", f"{wanted}, got {shown_value(sampler)}")
        return lanes_of(sampler, samples, lengths, controls, key)
    if len(sampler.sigma) != controls:
        problem = f"expected {controls} numbers, one per control, got {len(sampler.sigma)}"
        raise SettingError("sigma", problem)
    return sampler.build(samples, lengths, key, dt)
