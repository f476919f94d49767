"""Statistics of flights: intervals, tests, and what a sample of this size can show.

scipy.special has the distributions and loads in a tenth of the time of scipy.stats (.7 s), which
the functions that need it import themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, hypot, log, nan, sqrt

import numpy as np
from scipy.special import nctdtrinc, stdtr, stdtrit


@dataclass(frozen=True)
class Mean:
    """A mean with its Student t-interval."""

    mean: float
    low: float
    high: float
    n: int
    sd: float


def mean_interval(values: Sequence[float], confidence: float = 0.95) -> Mean:
    """mean +- t sd / sqrt(n); nan where n is too small to say. Of paired differences: the paired
    t-interval."""
    x = np.asarray(values, float)
    n = len(x)
    if n < 2:
        return Mean(float(x[0]) if n else nan, nan, nan, n, nan)
    mean, sd = float(x.mean()), float(x.std(ddof=1))
    half = float(stdtrit(n - 1, (1 + confidence) / 2)) * sd / sqrt(n)
    return Mean(mean, mean - half, mean + half, n, sd)


def ratio_interval(pairs: Sequence[tuple[float, float]]) -> Mean:
    """Geometric mean of b / a over the pairs (a, b) of positive numbers; sd: of the logarithms."""
    logs = mean_interval([log(b / a) for a, b in pairs if a > 0 < b])
    return Mean(exp(logs.mean), exp(logs.low), exp(logs.high), logs.n, logs.sd)


def upper_bound(values: Sequence[float], confidence: float = 0.95) -> float:
    """One-sided: the mean is below this with the given confidence; nan for fewer than two
    values."""
    return mean_interval(values, 2 * confidence - 1).high


def detectable(sd: float, n: int, power: float = 0.8) -> float:
    """The smallest true mean of n (paired) differences that a two-sided 5 % t-test detects with
    this power."""
    if n < 2:
        return nan
    t = stdtrit(n - 1, 0.975)  # a rejection on the wrong side is so rare that it is left out
    return float(nctdtrinc(n - 1, 1 - power, t)) * sd / sqrt(n)


def false_alarm(sd: float, n: int, effect: float, confidence: float) -> float:
    """Probability that `upper_bound` exceeds `effect` although the true mean is 0; `sd` of one
    difference."""
    if n < 2:
        return 1.0
    if not sd > 0:
        return 0.0
    # upper bound > effect  <=>  T > effect sqrt(n) / sd - t; taking sd as known in the first term
    return 1.0 - float(stdtr(n - 1, effect * sqrt(n) / sd - float(stdtrit(n - 1, confidence))))


def wilson(k: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Score interval of a proportion k/n (Wilson 1927)."""
    from scipy.stats import binomtest

    interval = binomtest(k, n).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)


def mcnemar(only_a: int, only_b: int) -> float:
    """Exact two-sided p that a and b succeed alike, from the pairs in which just one of them
    did."""
    from scipy.stats import binomtest

    return float(binomtest(only_a, only_a + only_b).pvalue) if only_a + only_b else 1.0


def fisher(k_a: int, n_a: int, k_b: int, n_b: int) -> float:
    """Fisher's exact two-sided p that k_a of n_a and k_b of n_b come from one proportion."""
    from scipy.stats import fisher_exact

    found = fisher_exact([[k_a, n_a - k_a], [k_b, n_b - k_b]])
    return float(found.pvalue)  # pyright: ignore[reportAttributeAccessIssue]: of its result, which has no stub


def proportion_difference(
    k_a: int, n_a: int, k_b: int, n_b: int, confidence: float = 0.95
) -> tuple[float, float]:
    """Interval of p_b - p_a from the two score intervals (Newcombe 1998, method 10)."""
    p_a, p_b = k_a / n_a, k_b / n_b
    (low_a, high_a), (low_b, high_b) = wilson(k_a, n_a, confidence), wilson(k_b, n_b, confidence)
    d = p_b - p_a
    return d - hypot(p_b - low_b, high_a - p_a), d + hypot(high_b - p_b, p_a - low_a)
