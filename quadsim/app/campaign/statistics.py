"""Statistics of flights: bounds, tests and what a sample of this size can show.

Intervals of success rates: quadsim.record.metrics.wilson; of means: quadsim.record.statistics.mean_interval.

scipy.special has the distributions and loads in a tenth of the time of scipy.stats.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, hypot, nan, sqrt

import numpy as np
from scipy.special import nctdtr, stdtr, stdtrit

from quadsim.record.metrics import wilson


def upper_bound(values: Sequence[float], confidence: float = 0.95) -> float:
    """One-sided: the mean is below this with the given confidence; nan for fewer than two values."""
    x = np.asarray(values, float)
    n = len(x)
    if n < 2:
        return nan
    return float(x.mean() + stdtrit(n - 1, confidence) * x.std(ddof=1) / sqrt(n))


def t_power(effect: float, sd: float, n: int, alpha: float = 0.05) -> float:
    """Chance that a two-sided t-test over n (paired) differences sees a true mean of `effect`."""
    if n < 2 or not sd > 0:
        return nan if n < 2 else float(effect != 0)
    t, shift = float(stdtrit(n - 1, 1 - alpha / 2)), abs(effect) * sqrt(n) / sd
    return 1.0 - float(nctdtr(n - 1, shift, t)) + float(nctdtr(n - 1, shift, -t))


def detectable(sd: float, n: int, power: float = 0.8) -> float:
    """The smallest true mean of n (paired) differences that a 5 % t-test sees with this power."""
    if n < 2 or not sd >= 0:
        return nan
    low, high = 0.0, 100.0 * sd
    while high - low > 1e-4 * sd:
        middle = (low + high) / 2
        low, high = (middle, high) if t_power(middle, sd, n) < power else (low, middle)
    return high


def false_alarm(sd: float, n: int, effect: float, confidence: float) -> float:
    """Chance that `upper_bound` exceeds `effect` although the true mean is 0; `sd` of one difference."""
    if n < 2:
        return 1.0
    if not sd > 0:
        return 0.0
    # upper bound > effect  <=>  T > effect sqrt(n) / sd - t; taking sd as known in the first term
    return 1.0 - float(stdtr(n - 1, effect * sqrt(n) / sd - float(stdtrit(n - 1, confidence))))


def mcnemar(only_a: int, only_b: int) -> float:
    """Exact two-sided p that a and b succeed alike, from the pairs in which just one of them did."""
    n, k = only_a + only_b, min(only_a, only_b)
    return min(1.0, 2.0 * sum(comb(n, i) for i in range(k + 1)) / 2.0**n)


def fisher(k_a: int, n_a: int, k_b: int, n_b: int) -> float:
    """Exact two-sided p that k_a of n_a and k_b of n_b come from one proportion: tables no likelier than this one."""
    k, n = k_a + k_b, n_a + n_b
    ways = [comb(n_a, i) * comb(n_b, k - i) for i in range(max(0, k - n_b), min(k, n_a) + 1)]
    this = comb(n_a, k_a) * comb(n_b, k_b)
    return sum(w for w in ways if w <= this) / comb(n, k)


def proportion_difference(k_a: int, n_a: int, k_b: int, n_b: int, z: float = 1.959964) -> tuple[float, float]:
    """Interval of p_b - p_a from the two score intervals (Newcombe 1998, method 10), 95 % by default."""
    p_a, p_b = k_a / n_a, k_b / n_b
    (low_a, high_a), (low_b, high_b) = wilson(k_a, n_a, z), wilson(k_b, n_b, z)
    d = p_b - p_a
    return d - hypot(p_b - low_b, high_a - p_a), d + hypot(high_b - p_b, p_a - low_a)
