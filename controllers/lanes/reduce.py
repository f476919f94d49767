"""The weighted mean of the sampled controls, computed in one pass over the noise."""

from __future__ import annotations

import numpy as np
from numba import njit

from quadsim.controllers.lanes import FAST
from quadsim.controllers.lanes.compiled import kept
from quadsim.controllers.lanes.layout import in_blocks
from quadsim.controllers.lanes.sharing import on_threads, share

CHUNK = 25  # number of steps of the horizon that a thread sums at a time: 6 kB of partial sums


@kept
@njit(fastmath=FAST, error_model="numpy", nogil=True)
def _lane_sums(  # noqa: PLR0913 (three are the arguments of each shared loop)
    desk, first, last, noise, ramp, U, low, high, weights, sums
):
    """Fill sums with sums[c, t, i] = sum_b w[b, i] (clip(U + ramp noise) - U).

    The threads share pairs of a control and CHUNK steps, from the pair `first` to before `last`,
    see lanes.sharing. Blocks are added in their order, so that the sums do not depend on the number
    of threads.
    """
    if desk:
        share(desk, last)  # pyright: ignore[reportCallIssue]
        return
    T = U.shape[0]
    blocks, lanes = weights.shape
    halves = noise.shape[2] // T
    chunks = (T + CHUNK - 1) // CHUNK
    for k in range(first, last):
        c = k // chunks
        begin = k % chunks * CHUNK
        end = min(begin + CHUNK, T)
        lo = low[c]
        hi = high[c]
        for t in range(begin, end):
            for i in range(lanes):
                sums[c, t, i] = 0
        for b in range(blocks):
            weighs = False
            for i in range(lanes):
                weighs |= weights[b, i] != 0
            if not weighs:
                continue
            s = b // halves
            t0 = (b % halves) * T
            for t in range(begin, end):
                u = U[t, c]
                n = ramp[b % 2, t]
                for i in range(lanes):
                    v = min(max(u + n * noise[s, c, t0 + t, i], lo), hi)
                    sums[c, t, i] += weights[b, i] * (v - u)


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
    pairs = n_u * -(-T // CHUNK)
    # An array with a different memory order would make numba compile the loop again.
    numbers = (ramp.astype(d, "C"), U.astype(d, "C"), low.astype(d), high.astype(d))
    on_threads(_lane_sums, pairs, noise, *numbers, w_blocks, sums)
    return sums.sum(axis=2, dtype=np.float64).T
