"""The records that a controller returns: statistics of a plan, and a snapshot for display."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class PlanStats:
    """Statistics of the last iteration of one control step.

    Examples:
        >>> from quadsim import PlanStats
        >>> stats = PlanStats(cost=4.2, ess=61.0, temperature=0.3)
        >>> stats.ess
        61.0
    """

    cost: float  # J of the unperturbed sample (sample 0), before the update
    ess: float  # effective sample size (ESS), 1 / sum w^2, 1..M
    temperature: float  # lambda that the weights were computed with


@dataclass(frozen=True, slots=True, eq=False)
class PlannerSnapshot:
    """The state of the planner at one control step, for display."""

    best: np.ndarray  # paths of the samples with the least cost, best first [m]  (8, points, 3)
    # Cost of the updated plan by term, horizon means that sum to its J; empty: not stored
    terms: dict[str, float]
