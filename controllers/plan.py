"""What a controller reports of its last plan: numbers at every control step, now and then its best sampled paths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class PlanStats:
    """What a controller reports of its last iteration."""

    cost: float  # J of the nominal plan (sample 0)
    ess: float  # effective sample size (ESS), 1 / sum w^2, 1..M
    temperature: float


@dataclass(frozen=True, slots=True, eq=False)
class PlannerSnapshot:
    """The planner at one control step, kept for display."""

    best: np.ndarray  # its best sampled paths, the cheapest first [m]  (8, points, 3)
    terms: dict[str, float]  # of the plan's cost J, horizon means, they sum to J; empty: not kept
