"""Planners of quadrotor races: Model Predictive Path Integral control (MPPI) and learned pilots.

The public names of this package are

    MPPI, MPPIConfig, PlanStats            the planner, see quadsim.controllers.mppi
    Cost, Term, crash                      costs as tuples of terms, see quadsim.controllers.costs
    Gaussian, Colored, LogNormal, Smooth, SmoothStar
                                           samplers, see quadsim.controllers.samplers
    PlainSampler                           the interface of a user's own sampler
    Planner, PRESETS, preset               numbers of the planner by name, see
                                           quadsim.controllers.presets

They are loaded on first use, so that `from quadsim import controllers` takes milliseconds. All
other names are internal and may change.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from quadsim.controllers.config import MPPIConfig as MPPIConfig
    from quadsim.controllers.costs import Cost as Cost
    from quadsim.controllers.costs import Term as Term
    from quadsim.controllers.costs import crash as crash
    from quadsim.controllers.mppi import MPPI as MPPI
    from quadsim.controllers.plan import PlanStats as PlanStats
    from quadsim.controllers.presets import PRESETS as PRESETS
    from quadsim.controllers.presets import Planner as Planner
    from quadsim.controllers.presets import preset as preset
    from quadsim.controllers.samplers import Colored as Colored
    from quadsim.controllers.samplers import Gaussian as Gaussian
    from quadsim.controllers.samplers import LogNormal as LogNormal
    from quadsim.controllers.samplers import PlainSampler as PlainSampler
    from quadsim.controllers.samplers import Smooth as Smooth
    from quadsim.controllers.samplers import SmoothStar as SmoothStar

_HOMES = {
    "MPPI": "quadsim.controllers.mppi",
    "MPPIConfig": "quadsim.controllers.config",
    "PlanStats": "quadsim.controllers.plan",
    "Cost": "quadsim.controllers.costs",
    "Term": "quadsim.controllers.costs",
    "crash": "quadsim.controllers.costs",
    "Gaussian": "quadsim.controllers.samplers",
    "Colored": "quadsim.controllers.samplers",
    "LogNormal": "quadsim.controllers.samplers",
    "Smooth": "quadsim.controllers.samplers",
    "SmoothStar": "quadsim.controllers.samplers",
    "PlainSampler": "quadsim.controllers.samplers",
    "Planner": "quadsim.controllers.presets",
    "PRESETS": "quadsim.controllers.presets",
    "preset": "quadsim.controllers.presets",
}
__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'controllers' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return list(__all__)
