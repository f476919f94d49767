"""A mean with its interval.

scipy.special has the distributions and loads in a tenth of the time of scipy.stats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan, sqrt

import numpy as np
from scipy.special import stdtrit


@dataclass(frozen=True)
class Mean:
    """A mean with its Student t-interval."""

    mean: float
    low: float
    high: float
    n: int
    sd: float


def mean_interval(values: Sequence[float], confidence: float = 0.95) -> Mean:
    """mean +- t sd / sqrt(n); nan where n is too small to say. Of paired differences: the paired t-interval."""
    x = np.asarray(values, float)
    n = len(x)
    if n < 2:
        return Mean(float(x[0]) if n else nan, nan, nan, n, nan)
    mean, sd = float(x.mean()), float(x.std(ddof=1))
    half = float(stdtrit(n - 1, (1 + confidence) / 2)) * sd / sqrt(n)
    return Mean(mean, mean - half, mean + half, n, sd)
