"""The weights of the samples, the temperature of that softmax, and a filter over the updated
plan."""

from __future__ import annotations

from math import isfinite

import numpy as np

TEMPERATURE_STEP = 1.1  # factor per iteration towards the target effective sample size
TEMPERATURE_RANGE = (1e-4, 1e4)
SAVITZKY_GOLAY = np.array([-3, 12, 17, 12, -3]) / 35  # 5 points, order 2


def weights(J: np.ndarray, temperature: float) -> np.ndarray:
    """w^m = exp(-(J^m - rho) / lambda) / eta, rho = min J; zero where J is not finite.  (M,) ->
    (M,)

    Raises FloatingPointError where no rollout has a finite cost.
    """
    w = softmax_weights(J, temperature)
    if not w.any():
        raise FloatingPointError(
            f"MPPI: cost: expected a finite J, got none in {len(J)} rollouts; lower the weights"
        )
    return w


def softmax_weights(J: np.ndarray, temperature: float) -> np.ndarray:
    """Weights of a chunk of samples, normalised within it; zeros where none of them has a finite
    cost.  (n,) -> (n,)

    layout.mean_of_chunks recombines the chunks.
    """
    if not isfinite(J.min()):
        J = np.where(np.isnan(J), np.inf, J)
    rho = J.min()
    if not isfinite(rho):
        return np.zeros_like(J)
    w = np.exp((rho - J) / temperature)
    return w / w.sum()


def adapt_temperature(temperature: float, ess: float, target: float | None) -> float:
    """The next temperature: higher by a fixed factor if the ESS is below the target, else lower;
    None: unchanged."""
    if target is None:
        return temperature
    low, high = TEMPERATURE_RANGE
    return min(max(temperature * TEMPERATURE_STEP ** (1 if ess < target else -1), low), high)


def savitzky_golay(plan: np.ndarray, executed: np.ndarray) -> np.ndarray:
    """The plan filtered over time; the executed controls pad its left, its last row its right.  (T,
    n_u)"""
    padded = np.vstack([executed, plan, plan[-1:], plan[-1:]])
    shifted = np.stack([padded[i : i + len(plan)] for i in range(len(SAVITZKY_GOLAY))])
    return np.tensordot(SAVITZKY_GOLAY, shifted, axes=1)
