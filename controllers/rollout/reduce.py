"""The weighted mean of the sampled controls, one pass over the noise."""

from __future__ import annotations

import numpy as np
from numba import njit, prange


@njit(fastmath=True, error_model="numpy", parallel=True, cache=True)
def _block_sums(noise, U, low, high, weights, sums):
    """sums[b, c, t] = sum_l w[b, l] (clip(U + noise) - U)."""
    T = U.shape[0]
    halves = noise.shape[2] // T
    for b in prange(weights.shape[0]):
        w = weights[b]
        if w.max() == 0:  # nothing of this block counts
            sums[b, :, :] = 0
            continue
        for c in range(U.shape[1]):
            E = noise[b // halves, c]
            t0 = (b % halves) * T
            lo, hi = low[c], high[c]
            for t in range(T):
                u = U[t, c]
                row = E[t0 + t]
                s = row[0] * 0
                for i in range(row.shape[0]):
                    s += w[i] * (min(max(u + row[i], lo), hi) - u)
                sums[b, c, t] = s


def weighted_mean(noise: np.ndarray, U: np.ndarray, low: np.ndarray, high: np.ndarray, w: np.ndarray) -> np.ndarray:
    """sum_m w_m (v^m - U), v = clip(U + noise).  noise (series, n_u, halves * T, LANES), w (blocks, LANES) -> (T, n_u)

    Blocks are added in their order, so the sum is the same for any number of threads.
    """
    dtype = noise.dtype
    sums = np.empty((len(w), U.shape[1], U.shape[0]), dtype)
    _block_sums(noise, U.astype(dtype), low.astype(dtype), high.astype(dtype), w.astype(dtype), sums)
    return sums.sum(axis=0, dtype=np.float64).T
