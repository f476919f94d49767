"""Timing one call many times: warm-up, median, 95th percentile. One thing at a time."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

WARM_UP = 3  # calls
LEAST = 15  # calls that count


def times_ms(call: Callable[[], object], seconds: float) -> np.ndarray:
    """Wall-clock of each call, for about so many seconds [ms].  (calls,)"""
    for _ in range(WARM_UP):
        call()
    taken: list[float] = []
    until = perf_counter() + seconds
    while len(taken) < LEAST or perf_counter() < until:
        began = perf_counter()
        call()
        taken.append(1e3 * (perf_counter() - began))
    return np.array(taken)


def median_ms(call: Callable[[], object], seconds: float) -> float:
    return float(np.median(times_ms(call, seconds)))
