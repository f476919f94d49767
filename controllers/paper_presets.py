"""The settings of Vlahov et al. 2024 for the double integrator (Table II) and the off-road vehicle
(Table I)."""

from __future__ import annotations

from typing import Any

from controllers.config import MPPIConfig
from controllers.costs.corridor import CorridorWeights
from controllers.costs.quadratic import QuadraticWeights
from controllers.presets import Planner
from controllers.samplers import Colored, Gaussian, LogNormal, Sampling, Smooth, SmoothStar


def _paper(
    vehicle: str, mppi: MPPIConfig, cost: Any, **sampling: Sampling
) -> dict[str, dict[str, Planner]]:
    return {"paper": {name: Planner(vehicle, s, mppi, cost) for name, s in sampling.items()}}


# M = 4096, T = 65, I = 1, dt = .015 s, lambda = 1. By the conventions of the authors' public
# library (MPPI-Generic, ACDSLab) every sample keeps the control that is about to be executed, the
# last 1 % of them perturb the rest control, and a Savitzky-Golay filter smooths the plan. sigma is
# the middle one of the table's three.
_SIGMA = (1.5, 1.5)
DOUBLE_INTEGRATOR = _paper(
    "point",
    MPPIConfig(
        samples=4096,
        horizon=65,
        iterations=1,
        dt=0.015,
        temperature=1.0,
        freeze_first=True,
        smooth=True,
    ),
    QuadraticWeights(),
    gaussian=Gaussian(_SIGMA),
    colored=Colored(_SIGMA, (1.0, 1.0)),
    log_normal=LogNormal(_SIGMA),
    smooth=Smooth(_SIGMA),
    smooth_star=SmoothStar(_SIGMA),
)

# Section IV-A: "I = 3 iterations, M = 6144 samples, lambda = 0.1, dt = 0.02 s, and T = 250"; "the
# control standard deviations were both set to 0.8, the combined throttle and brake exponent was 10,
# and the steering exponent was 4". The paper drives Gaussian and colored sampling; the others have
# the same sigma, that of `smooth`, which is the derivatives', divided by dt.
OFFROAD = _paper(
    "side_by_side",
    MPPIConfig(samples=6144, horizon=250, iterations=3, dt=0.02, temperature=0.1, smooth=True),
    CorridorWeights(),
    gaussian=Gaussian((0.8, 0.8)),
    colored=Colored((0.8, 0.8), (10.0, 4.0)),
    log_normal=LogNormal((0.8, 0.8)),
    smooth=Smooth((40.0, 40.0)),
    smooth_star=SmoothStar((0.8, 0.8)),
)
