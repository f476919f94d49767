"""What this machine can do at most: float32 arithmetic and memory traffic, measured."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from numba import njit, prange


@njit(parallel=True, cache=True)
def _triad(a, b, c):
    for i in prange(a.size):
        a[i] = b[i] + np.float32(3) * c[i]


def peak_gflops(size: int = 2048) -> float:
    """float32 matrix product by the machine's BLAS on all cores, the most arithmetic anything gets done [GFLOP/s]."""
    a = np.ones((size, size), np.float32)
    out = np.empty_like(a)
    return 2 * size**3 / _fastest(lambda: np.matmul(a, a, out=out)) / 1e9


def bandwidth_gb(size: int = 20_000_000) -> float:
    """Triad a = b + 3 c over arrays far larger than the caches; three arrays are moved [GB/s]."""
    a, b, c = (np.ones(size, np.float32) for _ in range(3))
    return 3 * a.nbytes / _fastest(lambda: _triad(a, b, c)) / 1e9


def _fastest(call, repeats: int = 5) -> float:
    call()
    return min(_seconds(call) for _ in range(repeats))


def _seconds(call) -> float:
    began = perf_counter()
    call()
    return perf_counter() - began
