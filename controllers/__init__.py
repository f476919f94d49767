"""Planners of quadrotor races: Model Predictive Path Integral control (MPPI) and learned pilots.

The public names of this package are

    MPPI, MPPIConfig, PlanStats            the planner, see controllers.mppi
    Cost, Term, crash                      costs as tuples of terms, see controllers.costs
    Gaussian, Colored, LogNormal, Smooth, SmoothStar
                                           samplers, see controllers.samplers
    PlainSampler                           the interface of a user's own sampler
    Planner, PRESETS, preset               numbers of the planner by name, see controllers.presets

They are loaded on first use, so that `import controllers` takes milliseconds.
Everything else is internal and may change.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from controllers.config import MPPIConfig as MPPIConfig
    from controllers.costs import Cost as Cost
    from controllers.costs import Term as Term
    from controllers.costs import crash as crash
    from controllers.mppi import MPPI as MPPI
    from controllers.plan import PlanStats as PlanStats
    from controllers.presets import PRESETS as PRESETS
    from controllers.presets import Planner as Planner
    from controllers.presets import preset as preset
    from controllers.samplers import Colored as Colored
    from controllers.samplers import Gaussian as Gaussian
    from controllers.samplers import LogNormal as LogNormal
    from controllers.samplers import PlainSampler as PlainSampler
    from controllers.samplers import Smooth as Smooth
    from controllers.samplers import SmoothStar as SmoothStar

_HOMES = {
    "MPPI": "controllers.mppi",
    "MPPIConfig": "controllers.config",
    "PlanStats": "controllers.plan",
    "Cost": "controllers.costs",
    "Term": "controllers.costs",
    "crash": "controllers.costs",
    "Gaussian": "controllers.samplers",
    "Colored": "controllers.samplers",
    "LogNormal": "controllers.samplers",
    "Smooth": "controllers.samplers",
    "SmoothStar": "controllers.samplers",
    "PlainSampler": "controllers.samplers",
    "Planner": "controllers.presets",
    "PRESETS": "controllers.presets",
    "preset": "controllers.presets",
}
__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'controllers' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return list(__all__)
