"""PlannerChange: a change of a planner's numbers in flight, as a run stores it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from controllers.config import MPPIConfig
from controllers.presets import Planner
from controllers.samplers import Sampling
from quadsim.config.parts import plain


@dataclass(frozen=True)
class PlannerChange:
    """A number that was changed in flight, and the planner's numbers after it."""

    t: float  # of the first plan with the number [s]
    name: str  # of the page's slider
    before: float
    after: float
    sampling: Sampling
    mppi: MPPIConfig

    def record(self) -> dict[str, Any]:
        """Return the change as JSON."""
        return {
            "t": self.t,
            "name": self.name,
            "from": self.before,
            "to": self.after,
            "planner": {"sampling": plain(self.sampling), "mppi": plain(self.mppi)},
        }

    def of(self, planner: Planner) -> Planner:
        """Return the planner with the numbers after this change."""
        return replace(planner, sampling=self.sampling, mppi=self.mppi)
