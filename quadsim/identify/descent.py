"""Descent: nonlinear least squares with a robust loss, a prior and limits.

The cost is a sum over residuals r and over x - mean, in standard deviations of the prior. A square
grows to a line beyond LOSS_SCALE, so that outliers count little.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from quadsim.identify.products import inner

LOSS_SCALE = 2.5  # residuals of more standard deviations than this count less
MOST_STEPS = 40  # of one search
FIRST_DAMPING = 1e-3
SMALLEST_DAMPING = 1e-9
LARGEST_DAMPING = 1e6
TINY = 1e-9  # room between limits that a search needs


class NumberLimits(NamedTuple):
    """The mean of the prior and the limits of each number, in standard deviations of the prior."""

    mean: np.ndarray  # (k,)
    low: np.ndarray  # (k,)
    high: np.ndarray  # (k,)


def descend(
    residuals: Callable[[np.ndarray], np.ndarray],
    derivatives: Callable[[np.ndarray, np.ndarray], np.ndarray],
    begin: np.ndarray,
    limits: NumberLimits,
    least_gain: float,
) -> tuple[np.ndarray, float]:
    """Return where a search ends, and its cost.

    The steps are those of Levenberg and Marquardt, within limits. `scipy.optimize.least_squares`
    takes the same steps, but decomposes the whole Jacobian in each of them, which would take most
    of the time here. The k x k normal equations are accurate enough, because the numbers are in
    standard deviations of their prior.

    Args:
        residuals: function of the numbers that returns residuals over their noise  (k,) -> (m,).
        derivatives: function of the numbers and their residuals that returns the Jacobian  (m, k).
        begin: numbers at which the search begins  (k,).
        limits: prior and limits of the numbers.
        least_gain: relative decrease of the cost at which the search ends.
    """
    mean, low, high = limits
    x = np.clip(begin, low, high)
    r = residuals(x)
    cost = soft_cost(r) + soft_cost(x - mean)
    damping = FIRST_DAMPING
    for _ in range(MOST_STEPS):
        H, g = normal_equations(derivatives(x, r), r)
        weight = soft_weight(x - mean)
        H += np.diag(weight)
        g += weight * (x - mean)
        gain = 0.0
        while damping < LARGEST_DAMPING:
            ahead = _step(x, H + damping * np.diag(np.diag(H)), g, low, high)
            r_ahead = residuals(ahead)
            gain = cost - soft_cost(r_ahead) - soft_cost(ahead - mean)
            if gain > 0.0:
                break
            damping *= 10.0
        if gain <= 0.0:
            break
        x, r, cost = ahead, r_ahead, cost - gain
        damping = max(0.1 * damping, SMALLEST_DAMPING)
        if gain < least_gain * cost:
            break
    return x, cost


def normal_equations(J: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return J' W J and J' W r with the weights W of the robust loss  (k, k), (k,)."""
    weighted = J * soft_weight(r)[:, None]
    return inner(weighted, J), inner(weighted, r[:, None])[:, 0]


def soft_cost(r: np.ndarray) -> float:
    """Return half the sum of a square whose growth slows to a line beyond LOSS_SCALE."""
    return float(LOSS_SCALE**2 * np.sum(np.sqrt(1.0 + (r / LOSS_SCALE) ** 2) - 1.0))


def soft_weight(r: np.ndarray) -> np.ndarray:
    """Return how much each residual counts, the slope of `soft_cost` over the residual."""
    return 1.0 / np.sqrt(1.0 + (r / LOSS_SCALE) ** 2)


def _step(
    x: np.ndarray, H: np.ndarray, g: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Return the x + d within limits at which g' d + d' H d / 2 is least."""
    R = np.linalg.cholesky(H).T
    found = lsq_linear(R, -np.linalg.solve(R.T, g), bounds=(low - x - TINY, high - x + TINY))
    return np.clip(x + found.x, low, high)
