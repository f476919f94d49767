"""How the perturbations and the stage cost are weighted along the horizon, steps t = 0..T-1 of a
rollout.

    v_t^m = clip(U_t + n_t z_t^m),   n_t from first_noise at t = 0 to 1 at the last step, linear, or
    1 throughout J^m   = (1/T) sum_t s_t q_t^m,   s_t = ((t + 1) / T)^cost_rise, divided by its mean

The plan is kept from one control step to the next, shifted: its first controls have been improved
by a hundred updates, its last by few. Perturbing the first ones less leaves more samples to the
search further on and calms the control that is executed. Every second block of samples is perturbed
in full all the same: where the plan no longer leads through a gate, as after a gust, these find
another way. A cost that rises over the horizon looks at where a sample leads rather than at how it
begins.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Schedule:
    """first_noise in (0, 1], cost_rise >= 0; the default weighs all steps alike, as the paper
    does."""

    first_noise: float = 1.0
    cost_rise: float = 0.0

    def noise(self, horizon: int) -> np.ndarray:
        """n_t, the factors on the perturbations of blocks of samples with an even and an odd
        number.  (2, T)"""
        return np.stack([np.linspace(self.first_noise, 1.0, horizon), np.ones(horizon)])

    def cost(self, horizon: int) -> np.ndarray:
        """s_t, the weights of the stage cost, 1 in the mean.  (T,)"""
        s = ((np.arange(horizon) + 1.0) / horizon) ** self.cost_rise
        return s / s.mean()
