"""Parameters of MPPI apart from its sampler and cost: the sampling budget and the update."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta

from quadsim.files.strict_yaml import unit


@dataclass(frozen=True)
class MPPIConfig:
    """Parameters of Algorithm 1 of Vlahov et al. 2024, with the paper's symbols M, T, I, dt, lambda, alpha.

    These are the library's defaults; `race fly` takes its values from a preset, see controllers/presets.py.
    """

    samples: Annotated[int, Meta(ge=2, le=10**6)] = 4096  # M, control sequences sampled per iteration
    horizon: Annotated[int, unit("steps", ge=2, le=10_000)] = 150  # T [steps]
    iterations: Annotated[int, Meta(ge=1, le=100)] = 2  # I, iterations per control step
    first_iterations: Annotated[int, Meta(ge=1, le=10_000)] | None = None  # of the first plan, made before the start
    dt: Annotated[float, unit("s", gt=0, le=0.5)] = 0.01  # control period [s]
    temperature: Annotated[float, Meta(gt=0, le=1e6)] = 0.3  # lambda, in units of the mean stage cost
    step_size: Annotated[float, Meta(gt=0, le=1)] = 1.0  # alpha, fraction of the update that is applied
    # With a smooth sampler these samples perturb the plan without its momentum instead, see MPPI.nominals in mppi.py.
    rest_fraction: Annotated[float, Meta(ge=0, le=1)] = 0.01  # of samples that perturb rest, or the cost's guide
    tighten: Annotated[float, Meta(ge=0, lt=1)] = 0.0  # fraction of the range from rest to each limit not used
    # The mean of clipped samples stays within the limits; a time-optimal control lies at them most of the time.
    overshoot: Annotated[float, Meta(ge=0, le=20)] = 0.0  # standard deviations by which a plan may exceed the limits
    first_noise: Annotated[float, Meta(ge=0.01, le=1)] = 1.0  # factor on the first perturbation of half of the samples
    cost_rise: Annotated[float, Meta(ge=0, le=10)] = 0.0  # the stage cost is weighted by ((t + 1) / T)^cost_rise
    adapt: bool = False  # estimate thrust gain, drag and maximum thrust in flight
    freeze_first: bool = False  # do not perturb the first control of the plan
    smooth: bool = False  # Savitzky-Golay filter over the plan after each update
    target_ess: Annotated[float, Meta(ge=1)] | None = None  # adapt the temperature to this effective sample size
