"""Statistics of flights: intervals, tests, and what a sample of this size can show.

scipy.stats takes .7 s to import, so the functions that need it import it themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, hypot, log, nan, sqrt

from scipy.special import nctdtr, stdtr, stdtrit

from quadsim.record.statistics import Mean, mean_interval


def ratio_interval(pairs: Sequence[tuple[float, float]]) -> Mean:
    """Geometric mean of b / a over the pairs (a, b) of positive numbers; sd: of the logarithms."""
    logs = mean_interval([log(b / a) for a, b in pairs if a > 0 < b])
    return Mean(exp(logs.mean), exp(logs.low), exp(logs.high), logs.n, logs.sd)


def upper_bound(values: Sequence[float], confidence: float = 0.95) -> float:
    """One-sided: the mean is below this with the given confidence; nan for fewer than two values."""
    return mean_interval(values, 2 * confidence - 1).high


def t_power(effect: float, sd: float, n: int, alpha: float = 0.05) -> float:
    """Probability that a two-sided t-test over n (paired) differences rejects when their true mean is `effect`."""
    if n < 2 or not sd > 0:
        return nan if n < 2 else float(effect != 0)
    t, shift = float(stdtrit(n - 1, 1 - alpha / 2)), abs(effect) * sqrt(n) / sd
    return 1.0 - float(nctdtr(n - 1, shift, t)) + float(nctdtr(n - 1, shift, -t))


def detectable(sd: float, n: int, power: float = 0.8) -> float:
    """The smallest true mean of n (paired) differences that a 5 % t-test detects with this power."""
    if n < 2 or not sd >= 0:
        return nan
    low, high = 0.0, 100.0 * sd
    while high - low > 1e-4 * sd:
        middle = (low + high) / 2
        low, high = (middle, high) if t_power(middle, sd, n) < power else (low, middle)
    return high


def false_alarm(sd: float, n: int, effect: float, confidence: float) -> float:
    """Probability that `upper_bound` exceeds `effect` although the true mean is 0; `sd` of one difference."""
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
    """Exact two-sided p that a and b succeed alike, from the pairs in which just one of them did."""
    from scipy.stats import binomtest

    return float(binomtest(only_a, only_a + only_b).pvalue) if only_a + only_b else 1.0


def fisher(k_a: int, n_a: int, k_b: int, n_b: int) -> float:
    """Fisher's exact two-sided p that k_a of n_a and k_b of n_b come from one proportion."""
    from scipy.stats import fisher_exact

    found = fisher_exact([[k_a, n_a - k_a], [k_b, n_b - k_b]])
    return float(found.pvalue)  # pyright: ignore[reportAttributeAccessIssue]: of its result, which has no stub


def proportion_difference(k_a: int, n_a: int, k_b: int, n_b: int, confidence: float = 0.95) -> tuple[float, float]:
    """Interval of p_b - p_a from the two score intervals (Newcombe 1998, method 10)."""
    p_a, p_b = k_a / n_a, k_b / n_b
    (low_a, high_a), (low_b, high_b) = wilson(k_a, n_a, confidence), wilson(k_b, n_b, confidence)
    d = p_b - p_a
    return d - hypot(p_b - low_b, high_a - p_a), d + hypot(high_b - p_b, p_a - low_a)
