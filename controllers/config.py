"""Parameters of MPPI apart from its sampler and cost: the sampling budget and the update."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Annotated

from quadsim.controllers.schedule import step_lengths
from quadsim.files.strict_yaml import setting
from quadsim.files.values import check_fields


@dataclass(frozen=True)
class MPPIConfig:
    """Parameters of Algorithm 1 of Vlahov et al. 2024, with its symbols M, T, I, dt and lambda.

    These are the library's defaults; `race fly` takes its values from a preset, see
    controllers/presets.py.

    Raises:
        SettingError: a number has a wrong type or is out of range (a ValueError).

    Examples:
        >>> from quadsim import MPPIConfig
        >>> config = MPPIConfig(samples=1024, horizon=60, dt=0.02, target_ess=50.0)
        >>> config.temperature
        0.3
        >>> try:
        ...     MPPIConfig(samples=0)
        ... except ValueError as error:
        ...     print(error)
        samples: expected a whole number >= 2 and <= 1e+06, got 0
    """

    samples: Annotated[
        int, setting("M, number of control sequences sampled per iteration", ge=2, le=10**6)
    ] = 4096
    horizon: Annotated[
        int,
        setting(
            "T, number of control periods planned ahead; with another dt, the preset's time",
            unit="steps",
            ge=2,
            le=10_000,
        ),
    ] = 150
    iterations: Annotated[
        int,
        setting(
            "I, number of iterations per control step, each with samples of its own", ge=1, le=100
        ),
    ] = 2
    first_iterations: (
        Annotated[
            int,
            setting("iterations of the first plan, made before the start", ge=1, le=10_000),
        ]
        | None
    ) = None
    news_iterations: (
        Annotated[
            int,
            setting(
                "iterations of a plan whose course has changed, as when a gate turns out to stand"
                " off the map; none: as in other plans",
                ge=1,
                le=10_000,
            ),
        ]
        | None
    ) = None
    dt: Annotated[float, setting("control period", unit="s", gt=0, le=0.5)] = 0.01
    temperature: Annotated[
        float, setting("lambda, in units of the mean stage cost", gt=0, le=1e6)
    ] = 0.3
    step_size: Annotated[
        float, setting("fraction alpha of the update that is applied", gt=0, le=1)
    ] = 1.0
    # With a smooth sampler these samples perturb the plan without momentum instead, see
    # MPPI.nominals in mppi.py.
    rest_fraction: Annotated[
        float,
        setting(
            "fraction of the samples that perturb the control at rest, or the cost's guide",
            ge=0,
            le=1,
        ),
    ] = 0.01
    tighten: Annotated[
        float,
        setting("unused fraction of the range from the control at rest to each limit", ge=0, lt=1),
    ] = 0.0
    # The mean of clipped samples lies inside the limits, but a time-optimal control is saturated
    # most of the time.
    overshoot: Annotated[
        float,
        setting("number of standard deviations by which a plan may exceed the limits", ge=0, le=20),
    ] = 0.0
    first_noise: Annotated[
        float, setting("factor on the first perturbation of half of the samples", ge=0.01, le=1)
    ] = 1.0
    cost_rise: Annotated[
        float,
        setting(
            "exponent of the weight ((t + 1) / T)^cost_rise of the cost of step t, which makes the"
            " first steps count little",
            ge=0,
            le=10,
        ),
    ] = 0.0
    adapt: Annotated[
        bool,
        setting("whether thrust gain, drag, highest thrust and rotors are estimated in flight"),
    ] = False
    longer_steps: (
        Annotated[
            float,
            setting(
                "time ahead after which the steps of rollouts are twice as long, and again after"
                " the same time, up to 0.04 s; none: each step is a control period",
                unit="s",
                gt=0,
                le=100,
            ),
        ]
        | None
    ) = None
    freeze_first: Annotated[
        bool, setting("whether the first control of the plan is left unperturbed")
    ] = False
    smooth: Annotated[
        bool,
        setting(
            "whether a Savitzky-Golay filter smooths the plan after each update; true behind"
            " betaflight"
        ),
    ] = False
    # The square root was found in flights with 512 to 4096 samples, see docs/samplers.md.
    target_ess: (
        Annotated[
            float,
            setting(
                "effective sample size of 1024 samples, for which each iteration solves the"
                " temperature; it grows with the square root of the samples",
                ge=1,
            ),
        ]
        | None
    ) = None

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def step_lengths(self) -> tuple[int, ...]:
        """The lengths of the steps of rollouts, in control periods; their sum is the horizon."""
        return step_lengths(self.horizon, self.dt, self.longer_steps)

    def ess_of(self, samples: int) -> float | None:
        """Return the target of the effective sample size for a number of samples.

        It is None if the temperature is fixed.
        """
        if self.target_ess is None:
            return None
        return self.target_ess * sqrt(samples / 1024)
