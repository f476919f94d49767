"""Weights of perturbations and stage cost along the horizon, steps t = 0..T-1 of a rollout.

    v_t^m = clip(U_t + n_t z_t^m)
    J^m   = (1/T) sum_t s_t q_t^m

The factor n_t rises linearly from first_noise at t = 0 to 1 at the last step, or is 1 throughout.
The factor s_t is ((t + 1) / T)^cost_rise, divided by its mean.

The plan is shifted and kept from one control step to the next: its first controls have been
improved by a hundred updates, its last controls by few. Perturbing the first controls less
concentrates the search on the later ones and makes the executed control smoother. Every second
block of samples is still perturbed in full: if the plan no longer leads through a gate, e.g. after
a gust, these samples find a different path. A cost that rises over the horizon gives the end of a
sample's path more weight than its beginning.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np


@dataclass(frozen=True)
class Schedule:
    """The two weights along the horizon; by default they are constant, as in the paper."""

    first_noise: float = 1.0  # in (0, 1]
    cost_rise: float = 0.0  # at least 0

    def noise(self, horizon: int) -> np.ndarray:
        """Return n_t, the factors on the perturbations, as a read-only array.

        Returns:
            Factors for the blocks of samples with even and with odd index  (2, T).
        """
        return _noise(self.first_noise, horizon)

    def cost(self, horizon: int) -> np.ndarray:
        """Return s_t, the weights of the stage cost, whose mean is 1.  (T,)

        The array is read-only.
        """
        return _cost(self.cost_rise, horizon)

    def marks(self, horizon: int, steps: int) -> np.ndarray:
        """Return the weights of terms that are computed at marks only.  (T,)

        Every `steps` steps, and at the end, there is a mark, whose weight is the sum of s_t since
        the mark before. The weights of all other steps are zero. The array is read-only.

        Args:
            horizon: T.
            steps: number of steps from one mark to the next.
        """
        return _marks(self.cost_rise, horizon, steps)


# Cached, as a planner uses these factors and weights in each control step
@lru_cache(maxsize=64)
def _noise(first_noise: float, horizon: int) -> np.ndarray:
    """Return the factors on the perturbations, see Schedule.noise.  (2, T)"""
    even = np.linspace(first_noise, 1.0, horizon)
    odd = np.ones(horizon)
    factors = np.stack([even, odd])
    factors.flags.writeable = False
    return factors


@lru_cache(maxsize=64)
def _cost(cost_rise: float, horizon: int) -> np.ndarray:
    """Return the weights of the stage cost, see Schedule.cost.  (T,)"""
    s = ((np.arange(horizon) + 1.0) / horizon) ** cost_rise
    weights = s / s.mean()
    weights.flags.writeable = False
    return weights


@lru_cache(maxsize=64)
def _marks(cost_rise: float, horizon: int, steps: int) -> np.ndarray:
    """Return the weights at marks, see Schedule.marks.  (T,)"""
    sums = np.cumsum(_cost(cost_rise, horizon))
    marks = np.append(np.arange(steps - 1, horizon - 1, steps), horizon - 1)
    weights = np.zeros(horizon)
    weights[marks] = np.diff(sums[marks], prepend=0.0)
    weights.flags.writeable = False
    return weights
