"""Statistics of flights: intervals, tests, and the differences that a sample can detect.

The distributions come from scipy.special, which loads in a tenth of the time of scipy.stats (0.7
s). Functions that need scipy.stats import it themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, hypot, log, nan, sqrt

import numpy as np
from scipy.special import nctdtrinc, ndtri, stdtr, stdtrit


@dataclass(frozen=True)
class Mean:
    """A mean with its Student t-interval from `low` to `high`.

    Examples:
        >>> from quadsim.statistics import mean_interval
        >>> mean_interval([1.0, 2.0, 3.0]).mean
        2.0
    """

    mean: float
    low: float
    high: float
    n: int
    sd: float


def mean_interval(values: Sequence[float], confidence: float = 0.95) -> Mean:
    """Return the mean with the interval mean +- t sd / sqrt(n), or nan if n is too small.

    For paired differences this is the paired t-interval.
    """
    x = np.asarray(values, float)
    n = len(x)
    if n < 2:
        return Mean(float(x[0]) if n else nan, nan, nan, n, nan)
    mean = float(x.mean())
    sd = float(x.std(ddof=1))
    half = float(stdtrit(n - 1, (1 + confidence) / 2)) * sd / sqrt(n)
    return Mean(mean, mean - half, mean + half, n, sd)


def clustered_mean(groups: Sequence[Sequence[float]], confidence: float = 0.95) -> Mean:
    """Return the mean of all values, with an interval for values that are alike within a group.

    The variance is estimated from the groups' sums of residuals (cluster-robust variance, Liang and
    Zeger 1986), with Student's t for the number of groups minus one. If each group has one value,
    the result equals `mean_interval`. It is nan for fewer than two groups.

    Args:
        groups: the values of each group, such as the times of the flights of one race.
        confidence: confidence of the interval.
    """
    arrays = [np.asarray(group, float) for group in groups if len(group)]
    x = np.concatenate(arrays) if arrays else np.empty(0)
    count = len(arrays)
    if count < 2:
        return Mean(float(x.mean()) if len(x) else nan, nan, nan, len(x), nan)
    mean = float(x.mean())
    residuals = np.array([(array - mean).sum() for array in arrays])
    variance = count / (count - 1) * float(residuals @ residuals) / len(x) ** 2
    half = float(stdtrit(count - 1, (1 + confidence) / 2)) * sqrt(variance)
    return Mean(mean, mean - half, mean + half, len(x), float(x.std(ddof=1)))


def ratio_interval(pairs: Sequence[tuple[float, float]]) -> Mean:
    """Return the geometric mean of b / a over the pairs (a, b) of positive numbers.

    The `sd` of the result is the standard deviation of the logarithms. Pairs with a number that is
    not positive are left out.
    """
    logs = mean_interval([log(b / a) for a, b in pairs if a > 0 < b])
    return Mean(exp(logs.mean), exp(logs.low), exp(logs.high), logs.n, logs.sd)


def p_of_mean(mean: Mean) -> float:
    """Return the two-sided p-value of the t-test that the true mean is 0.

    It is nan for fewer than two values. For paired differences this is the paired t-test.
    """
    if mean.n < 2:
        return nan
    if not mean.sd > 0.0:
        return 1.0 if mean.mean == 0.0 else 0.0
    t = mean.mean * sqrt(mean.n) / mean.sd
    return float(2.0 * stdtr(mean.n - 1, -abs(t)))


def p_of_ratio(ratio: Mean) -> float:
    """Return the two-sided p-value that the true ratio is 1, for a result of `ratio_interval`."""
    return p_of_mean(Mean(log(ratio.mean), nan, nan, ratio.n, ratio.sd) if ratio.n else ratio)


def holm(ps: Sequence[float]) -> list[float]:
    """Return p-values that are corrected for their number (Holm 1979).

    At a level of 5 %, the probability that any true hypothesis is rejected is at most 5 %, whatever
    the dependence between the tests. A nan remains nan, and is not counted.

    Args:
        ps: p-values of the tests of one family.

    Examples:
        >>> from quadsim.statistics import holm
        >>> holm([0.01, 0.04, 0.03, 0.005])
        [0.03, 0.06, 0.06, 0.02]
    """
    known = sorted((p, k) for k, p in enumerate(ps) if p == p)
    corrected = [nan] * len(ps)
    largest = 0.0
    for rank, (p, k) in enumerate(known):
        largest = max(largest, min(1.0, (len(known) - rank) * p))
        corrected[k] = largest
    return corrected


def upper_bound(values: Sequence[float], confidence: float = 0.95) -> float:
    """Return the one-sided upper bound of the mean with the given confidence.

    It is nan for fewer than two values.
    """
    return mean_interval(values, 2 * confidence - 1).high


def detectable(sd: float, n: int, power: float = 0.8) -> float:
    """Return the smallest true mean that a two-sided 5 % t-test detects with a given power.

    Args:
        sd: standard deviation of a single (paired) difference.
        n: number of differences.
        power: probability of detection.
    """
    if n < 2:
        return nan
    # A rejection on the wrong side is so rare that it is left out
    t = stdtrit(n - 1, 0.975)
    return float(nctdtrinc(n - 1, 1 - power, t)) * sd / sqrt(n)


def false_alarm(sd: float, n: int, effect: float, confidence: float) -> float:
    """Return the probability that `upper_bound` exceeds `effect` although the true mean is 0.

    Args:
        sd: standard deviation of a single difference.
        n: number of differences.
        effect: the bound that raises an alarm.
        confidence: confidence of `upper_bound`.
    """
    if n < 2:
        return 1.0
    if not sd > 0:
        return 0.0
    # upper bound > effect  <=>  T > effect sqrt(n) / sd - t; sd is taken as known in the first term
    t = float(stdtrit(n - 1, confidence))
    return 1.0 - float(stdtr(n - 1, effect * sqrt(n) / sd - t))


def wilson(k: int, n: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the score interval of a proportion k/n (Wilson 1927)."""
    from scipy.stats import binomtest

    interval = binomtest(k, n).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)


def clustered_wilson(
    successes: Sequence[int], sizes: Sequence[int], confidence: float = 0.95
) -> tuple[float, float]:
    """Return the score interval of a proportion whose trials are alike within a group.

    It is Wilson's interval for an effective number of trials (Korn and Graubard 1998): the number
    of independent trials with the same variance as the groups' successes, at most the number of all
    trials, with Student's t for the number of groups minus one. If all trials or no trials succeed
    there is no variance, and each group counts as one trial.

    Args:
        successes: successes in each group, such as the flights of one race that have finished.
        sizes: trials in each group.
        confidence: confidence of the interval.
    """
    k = np.asarray(successes, float)
    n = np.asarray(sizes, float)
    groups = len(k)
    trials = float(n.sum())
    p = float(k.sum()) / trials
    if groups < 2 or p in (0.0, 1.0):
        return _score_interval(p, groups, confidence)
    residuals = k - p * n
    variance = groups / (groups - 1) * float(residuals @ residuals) / trials**2
    independent = p * (1.0 - p)
    effective = min(independent / variance, trials) if variance > 0.0 else trials
    t = float(stdtrit(groups - 1, (1 + confidence) / 2))
    return _score_interval(p, effective * (_normal(confidence) / t) ** 2, confidence)


def _normal(confidence: float) -> float:
    """Return half of the width of a two-sided interval of the standard normal distribution."""
    return float(ndtri((1 + confidence) / 2))


def _score_interval(p: float, n: float, confidence: float) -> tuple[float, float]:
    """Return Wilson's interval of a proportion p among n trials; n need not be an integer."""
    z = _normal(confidence)
    centre = p + z * z / (2.0 * n)
    half = z * sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n))
    low, high = ((centre + sign * half) / (1.0 + z * z / n) for sign in (-1.0, 1.0))
    return max(low, 0.0), min(high, 1.0)


def mcnemar(only_a: int, only_b: int) -> float:
    """Return McNemar's exact two-sided p-value that a and b are equally successful.

    Args:
        only_a: number of pairs in which only a succeeded.
        only_b: number of pairs in which only b succeeded.
    """
    from scipy.stats import binomtest

    if only_a + only_b == 0:
        return 1.0
    return float(binomtest(only_a, only_a + only_b).pvalue)


def fisher(k_a: int, n_a: int, k_b: int, n_b: int) -> float:
    """Return Fisher's exact two-sided p-value that k_a / n_a and k_b / n_b are equal."""
    from scipy.stats import fisher_exact

    found = fisher_exact([[k_a, n_a - k_a], [k_b, n_b - k_b]])
    # The result has no stub
    return float(found.pvalue)  # pyright: ignore[reportAttributeAccessIssue]


def proportion_difference(
    k_a: int, n_a: int, k_b: int, n_b: int, confidence: float = 0.95
) -> tuple[float, float]:
    """Return the interval of p_b - p_a from the two score intervals (Newcombe 1998, method 10).

    Args:
        k_a: successes of a.
        n_a: attempts of a.
        k_b: successes of b.
        n_b: attempts of b.
        confidence: confidence of the interval.
    """
    p_a = k_a / n_a
    p_b = k_b / n_b
    low_a, high_a = wilson(k_a, n_a, confidence)
    low_b, high_b = wilson(k_b, n_b, confidence)
    difference = p_b - p_a
    low = difference - hypot(p_b - low_b, high_a - p_a)
    high = difference + hypot(high_b - p_b, p_a - low_a)
    return low, high
