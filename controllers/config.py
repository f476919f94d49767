"""The numbers of MPPI besides its sampler and cost: the budget and the update."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from quadsim.files.strict_yaml import unit


@dataclass(frozen=True)
class MPPIConfig:
    """Numbers of Algorithm 1 of Vlahov et al. 2024, with the paper's symbols M, T, I, dt, lambda, alpha."""

    samples: Annotated[int, Meta(ge=2, le=10**6)] = 4096  # M, controls sampled per iteration
    horizon: Annotated[int, unit("steps", ge=2, le=10_000)] = 150  # T [steps]
    iterations: Annotated[int, Meta(ge=1, le=100)] = 2  # I
    dt: Annotated[float, unit("s", gt=0, le=0.5)] = 0.01  # control period [s]
    temperature: Annotated[float, Meta(gt=0, le=1e6)] = 0.3  # lambda, in units of the mean cost
    step_size: Annotated[float, Meta(gt=0, le=1)] = 1.0  # alpha, share of the update that is taken
    rest_fraction: Annotated[float, Meta(ge=0, le=1)] = 0.01  # of the samples: perturb the rest control, not the plan
    tighten: Annotated[float, Meta(ge=0, lt=1)] = 0.0  # share of the way from rest to each limit left unused
    adapt: bool = False  # learn thrust gain, drag and the highest thrust in flight
    freeze_first: bool = False  # every sample keeps the plan's first control
    smooth: bool = False  # Savitzky-Golay filter over the plan after each update
    target_ess: Annotated[float, Meta(ge=1)] | None = None  # steer the temperature to this effective sample size
