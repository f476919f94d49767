"""The weighted mean of the sampled controls, one pass over the noise."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from controllers.lanes import FAST
from controllers.lanes.compiled import kept
from controllers.lanes.layout import in_blocks

CHUNK = 25  # steps a thread sums at a time: 6 kB of partial sums


@kept
@njit(fastmath=FAST, error_model="numpy", parallel=True)
def _lane_sums(noise, ramp, U, low, high, weights, sums):
    """sums[c, t, l] = sum_b w[b, l] (clip(U + ramp noise) - U): block after block, so every thread
    count adds alike."""
    T, n_u = U.shape
    halves = noise.shape[2] // T
    chunks = (T + CHUNK - 1) // CHUNK
    for k in prange(n_u * chunks):
        c, first = k // chunks, k % chunks * CHUNK
        last = min(first + CHUNK, T)
        lo, hi = low[c], high[c]
        sums[c, first:last] = 0
        for b in range(weights.shape[0]):
            w = weights[b]
            if w.max() == 0:  # nothing of this block counts
                continue
            E = noise[b // halves, c]
            t0 = (b % halves) * T
            for t in range(first, last):
                u, n = U[t, c], ramp[b % 2, t]
                row, s = E[t0 + t], sums[c, t]
                for i in range(row.shape[0]):
                    s[i] += w[i] * (min(max(u + n * row[i], lo), hi) - u)


def weighted_mean(
    noise: np.ndarray,
    ramp: np.ndarray,
    U: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    w: np.ndarray,
) -> np.ndarray:
    """sum_m w_m (v^m - U), v_t = clip(U_t + ramp_t z_t), ramp (2, T) of even and odd blocks.

    z (series, n_u, halves * T, LANES), w (M,) -> (T, n_u)
    """
    d, w = noise.dtype, in_blocks(w)
    sums = np.empty((U.shape[1], U.shape[0], w.shape[1]), d)
    _lane_sums(noise, ramp.astype(d), U.astype(d), low.astype(d), high.astype(d), w.astype(d), sums)
    return sums.sum(axis=2, dtype=np.float64).T
