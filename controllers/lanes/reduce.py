"""The weighted mean of the sampled controls, computed in one pass over the noise."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from controllers.lanes import FAST
from controllers.lanes.compiled import kept
from controllers.lanes.layout import in_blocks

CHUNK = 25  # steps of the horizon that a thread sums at a time: 6 kB of partial sums


@kept
@njit(fastmath=FAST, error_model="numpy", parallel=True, nogil=True)
def _lane_sums(noise, ramp, U, low, high, weights, sums):
    """Fill sums with sums[c, t, l] = sum_b w[b, l] (clip(U + ramp noise) - U).

    Blocks are added in their order, so that the sums do not depend on the number of threads.
    """
    T, n_u = U.shape
    halves = noise.shape[2] // T
    chunks = (T + CHUNK - 1) // CHUNK
    for k in prange(n_u * chunks):
        c = k // chunks
        first = k % chunks * CHUNK
        last = min(first + CHUNK, T)
        lo = low[c]
        hi = high[c]
        sums[c, first:last] = 0
        for b in range(weights.shape[0]):
            w = weights[b]
            if w.max() == 0:
                continue
            E = noise[b // halves, c]
            t0 = (b % halves) * T
            for t in range(first, last):
                u = U[t, c]
                n = ramp[b % 2, t]
                row = E[t0 + t]
                s = sums[c, t]
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
    """Return sum_m w_m (v^m - U) with v_t = clip(U_t + ramp_t z_t).

    Args:
        noise: perturbations z  (series, n_u, halves * T, LANES).
        ramp: factors on the perturbations of even and of odd blocks  (2, T).
        U: plan  (T, n_u).
        low, high: limits of the controls  (n_u,).
        w: weight of each sample  (M,).

    Returns:
        The weighted mean  (T, n_u).
    """
    d = noise.dtype
    w_blocks = in_blocks(w).astype(d)
    T, n_u = U.shape
    sums = np.empty((n_u, T, w_blocks.shape[1]), d)
    _lane_sums(noise, ramp.astype(d), U.astype(d), low.astype(d), high.astype(d), w_blocks, sums)
    return sums.sum(axis=2, dtype=np.float64).T
