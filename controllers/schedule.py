"""Steps of a rollout, and weights of perturbations and stage cost along them, t = 0..T-1.

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

Later steps may be longer than a control period, because samples spread with time, so that the end
of the horizon need not be as fine as its beginning. Both factors are laws of time: a step of
several periods has the mean of their noise and of their n_t, and the sum of their s_t.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import accumulate

import numpy as np

# The longest step [s]: in a step a sample flies straight for the tests against frames.
LONGEST_STEP = 0.04


@dataclass(frozen=True)
class Schedule:
    """The steps of a rollout, and two weights along them.

    By default the steps are equal and the weights are constant, as in the paper.
    """

    first_noise: float = 1.0  # in (0, 1]
    cost_rise: float = 0.0  # at least 0
    # Length of each step in control periods; (): each is one period
    lengths: tuple[int, ...] = ()

    def periods(self, steps: int) -> np.ndarray:
        """Return the length of each of T steps, in control periods.  (T,)"""
        return np.array(self.lengths or (1,) * steps)

    def noise(self, horizon: int) -> np.ndarray:
        """Return n_t, the factors on the perturbations, as a read-only array.

        Args:
            horizon: T, number of steps.

        Returns:
            Factors for the blocks of samples with even and with odd index  (2, T).
        """
        return _noise(self.first_noise, self.lengths or (1,) * horizon)

    def cost(self, horizon: int) -> np.ndarray:
        """Return s_t, the weights of the stage cost, whose mean is 1.  (T,)

        The array is read-only.

        Args:
            horizon: T, number of steps.
        """
        return _cost(self.cost_rise, self.lengths or (1,) * horizon)

    def marks(self, horizon: int, periods: int) -> np.ndarray:
        """Return the weights of terms that are computed at marks only.  (T,)

        Every `periods` control periods, and at the end, there is a mark, whose weight is the sum of
        s_t since the mark before. The weights of all other steps are zero. The array is read-only.

        Args:
            horizon: T, number of steps.
            periods: number of control periods from one mark to the next.
        """
        return _marks(self.cost_rise, self.lengths or (1,) * horizon, periods)


def step_lengths(horizon: int, dt: float, doubling: float | None) -> tuple[int, ...]:
    """Return the lengths of the steps of a rollout in control periods, whose sum is the horizon.

    Args:
        horizon: number of control periods.
        dt: control period [s].
        doubling: time after which steps are twice as long, and again after the same time [s]; None:
            all steps are control periods.

    Examples:
        >>> from quadsim.controllers.schedule import step_lengths
        >>> step_lengths(horizon=12, dt=0.01, doubling=0.03)
        (1, 1, 1, 2, 2, 4, 1)
    """
    if doubling is None:
        return (1,) * horizon
    lengths: list[int] = []
    flown, length = 0, 1
    until = max(round(doubling / dt), 1)
    while flown < horizon:
        is_due = flown >= until and 2 * length * dt < LONGEST_STEP + 1e-9
        if is_due:
            length *= 2
            until += max(round(doubling / dt), 1)
        lengths.append(min(length, horizon - flown))
        flown += lengths[-1]
    return tuple(lengths)


def first_periods(lengths: Sequence[int]) -> np.ndarray:
    """Return the index of the first control period of each step.  (T,)"""
    return np.array([0, *accumulate(lengths)][:-1])


def marks_at(lengths: Sequence[int], periods: int) -> np.ndarray:
    """Return the steps with a mark: every `periods` control periods, and the last one."""
    passed = np.cumsum(lengths) // periods
    is_mark = np.diff(passed, prepend=0) > 0
    is_mark[-1] = True
    return np.flatnonzero(is_mark)


# Cached, as a planner uses these factors and weights in each control step
@lru_cache(maxsize=64)
def _noise(first_noise: float, lengths: tuple[int, ...]) -> np.ndarray:
    """Return the factors on the perturbations, see Schedule.noise.  (2, T)"""
    rising = np.linspace(first_noise, 1.0, sum(lengths))
    even = np.add.reduceat(rising, first_periods(lengths)) / lengths
    odd = np.ones(len(lengths))
    factors = np.stack([even, odd])
    factors.flags.writeable = False
    return factors


@lru_cache(maxsize=64)
def _cost(cost_rise: float, lengths: tuple[int, ...]) -> np.ndarray:
    """Return the weights of the stage cost, see Schedule.cost.  (T,)"""
    periods = sum(lengths)
    s = ((np.arange(periods) + 1.0) / periods) ** cost_rise
    weights = np.add.reduceat(s / s.mean(), first_periods(lengths))
    if len(lengths) < periods:
        weights *= len(lengths) / periods
    weights.flags.writeable = False
    return weights


@lru_cache(maxsize=64)
def _marks(cost_rise: float, lengths: tuple[int, ...], periods: int) -> np.ndarray:
    """Return the weights at marks, see Schedule.marks.  (T,)"""
    sums = np.cumsum(_cost(cost_rise, lengths))
    marks = marks_at(lengths, periods)
    weights = np.zeros(len(lengths))
    weights[marks] = np.diff(sums[marks], prepend=0.0)
    weights.flags.writeable = False
    return weights
