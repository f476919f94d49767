"""The update of a plan: weights of the samples, their temperature, and a filter over the plan."""

from __future__ import annotations

from math import exp, isfinite, log

import numpy as np

TEMPERATURE_RANGE = (1e-4, 1e4)
ESS_TOLERANCE = 0.01  # of the logarithm of the effective sample size
MOST_STEPS = 40  # of the search for a temperature; some four are enough
SAVITZKY_GOLAY = np.array([-3, 12, 17, 12, -3]) / 35  # 5 points, order 2


def weights(J: np.ndarray, temperature: float) -> np.ndarray:
    """Return w^m = exp(-(J^m - rho) / lambda) / eta with rho = min J; zero if J is not finite.

    Args:
        J: cost of each sample  (M,).
        temperature: lambda.

    Returns:
        The weights, whose sum is 1  (M,).

    Raises:
        FloatingPointError: no rollout has a finite cost.
    """
    w = softmax_weights(J, temperature)
    if not w.any():
        undefined = int(np.isnan(J).sum())
        problem = "none: lower the weights"
        if undefined:
            problem = f"{undefined} times NaN: does a term divide by zero or take a negative root?"
        wanted = f"expected a finite J in one of {len(J)} rollouts"
        raise FloatingPointError(f"MPPI: cost: {wanted}, got {problem}")
    return w


def softmax_weights(J: np.ndarray, temperature: float) -> np.ndarray:
    """Return the weights of a chunk of samples, normalised within the chunk.

    `layout.mean_of_chunks` recombines the chunks.

    Args:
        J: cost of each sample of the chunk  (n,).
        temperature: lambda.

    Returns:
        The weights, whose sum is 1, or zeros if no sample has a finite cost  (n,).
    """
    if not isfinite(J.min()):
        J = np.where(np.isnan(J), np.inf, J)
    rho = J.min()
    if not isfinite(rho):
        return np.zeros_like(J)
    w = np.exp((rho - J) / temperature)
    return w / w.sum()


def solve_temperature(J: np.ndarray, target: float, temperature: float) -> float:
    """Return the temperature at which the weights have a wanted effective sample size.

    log ESS rises with log lambda: d log ESS / d log lambda = 2 (E_w[x] - E_{w^2}[x]) >= 0 with
    x = (J - rho) / lambda and means under the weights w and w^2. Newton's method in the logarithms
    is kept inside a bracket, which is halved if a step leaves it.

    Args:
        J: cost of each sample  (n,).
        target: effective sample size to reach, below n.
        temperature: lambda from which the search starts.

    Returns:
        lambda, at which the effective sample size is within ESS_TOLERANCE of the target, or
        else the nearest end of TEMPERATURE_RANGE; `temperature` if no sample has a finite cost.
    """
    finite = J[np.isfinite(J)]
    if not len(finite):
        return temperature
    above = finite - finite.min()  # J - rho
    low, high = (log(end) for end in TEMPERATURE_RANGE)
    wanted = log(min(target, len(above)))
    s = min(max(log(temperature), low), high)  # log lambda
    for _ in range(MOST_STEPS):
        x = above * exp(-s)
        w = np.exp(-x)
        sum_w, sum_ww = w.sum(), w @ w
        missing = wanted - log(sum_w * sum_w / sum_ww)
        if abs(missing) < ESS_TOLERANCE:
            break
        low, high = (s, high) if missing > 0 else (low, s)
        slope = 2 * float((w @ x) / sum_w - ((w * w) @ x) / sum_ww)
        s = s + missing / slope if slope > 0 else low
        if not low < s < high:
            s = (low + high) / 2
    return exp(s)


def savitzky_golay(plan: np.ndarray, executed: np.ndarray) -> np.ndarray:
    """Return the plan filtered over time.

    Args:
        plan: U  (T, n_u), padded at the end by its last row.
        executed: the last two executed controls, which pad the beginning  (2, n_u).

    Returns:
        The filtered plan  (T, n_u).
    """
    padded = np.vstack([executed, plan, plan[-1:], plan[-1:]])
    shifted = np.stack([padded[i : i + len(plan)] for i in range(len(SAVITZKY_GOLAY))])
    return np.tensordot(SAVITZKY_GOLAY, shifted, axes=1)
