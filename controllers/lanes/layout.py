"""The memory layout of samples: perturbations z of shape (series, n_u, halves * T, LANES).

LANES samples, one in each lane of the vector code, make a block. A series has one block of T steps,
or two blocks (halves) one after the other in time, because one Fourier transform of length 2 T
yields two samples. Sample m is lane m % LANES of block m // LANES. One number per sample, such as a
cost or weight, has the shape (blocks, LANES).

At most CHUNK samples are in memory at a time, in whole blocks of whole series, so that they fit the
processor's caches.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

LANES = 64
CHUNK = 2048  # samples: 5 MB of perturbations at the paper's horizon


def blocks(samples: int) -> int:
    """Return the number of blocks that hold `samples` samples."""
    return -(-samples // LANES)


def chunks(samples: int) -> Iterator[slice]:
    """Yield the indices of the samples in chunks of at most CHUNK."""
    for first in range(0, samples, CHUNK):
        yield slice(first, min(first + CHUNK, samples))


def mean_of_chunks(means: Sequence[np.ndarray], weights: np.ndarray) -> np.ndarray:
    """Return the weighted mean over all samples from the means of the chunks.

    Each chunk is weighted by its share of the total weight.

    Args:
        means: weighted mean of each chunk  (T, n_u) each.
        weights: weight of each sample; their sum is 1  (M,).

    Returns:
        The weighted mean  (T, n_u).
    """
    firsts = [chunk.start for chunk in chunks(len(weights))]
    shares = np.add.reduceat(weights, firsts)
    return np.tensordot(shares, means, axes=1)


def in_blocks(numbers: np.ndarray) -> np.ndarray:
    """Return one number per sample (M,) in blocks; lanes without a sample are zero.

    Returns:
        The numbers  (blocks, LANES).
    """
    padded = np.zeros(blocks(len(numbers)) * LANES)
    padded[: len(numbers)] = numbers
    return padded.reshape(-1, LANES)


def block(z: np.ndarray, b: int, horizon: int) -> np.ndarray:
    """Return block b of perturbations, a view.  (n_u, T, LANES)"""
    halves = z.shape[2] // horizon
    t0 = (b % halves) * horizon
    return z[b // halves, :, t0 : t0 + horizon]


def sample(z: np.ndarray, m: int, horizon: int) -> np.ndarray:
    """Return sample m of perturbations, a view.  (n_u, T)"""
    return block(z, m // LANES, horizon)[:, :, m % LANES]


def first_steps(z: np.ndarray, horizon: int) -> np.ndarray:
    """Return the first step of every sample, a view.  (series, n_u, halves, LANES)"""
    return z[:, :, ::horizon]


def of_steps(z: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the perturbations of the chosen steps.

    Args:
        z: perturbations  (series, n_u, halves * T, LANES).
        chosen: whether a step is chosen  (T,).

    Returns:
        (series, n_u, halves * chosen steps, LANES)
    """
    if chosen.all():
        return z
    return np.compress(np.tile(chosen, z.shape[2] // len(chosen)), z, axis=2)


def add_from(z: np.ndarray, first: int, samples: int, offset: np.ndarray) -> None:
    """Add an offset to each sample from number `first` on.

    Args:
        z: perturbations  (series, n_u, halves * T, LANES).
        first: number of the first sample that is changed.
        samples: number of samples.
        offset: offsets of even and of odd blocks  (2, T, n_u).
    """
    T = offset.shape[1]
    for b in range(first // LANES, blocks(samples)):
        first_lane = max(first - b * LANES, 0)
        block(z, b, T)[:, :, first_lane:] += offset[b % 2].T[:, :, None]


def in_lanes(rows: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Fill z with samples and return it; missing lanes are zero.

    Args:
        rows: perturbations  (samples, T, n_u).
        z: array to fill  (blocks, n_u, T, LANES).
    """
    z[-1] = 0
    for b, lanes in enumerate(np.split(rows, range(LANES, len(rows), LANES))):
        z[b, :, :, : len(lanes)] = lanes.transpose(2, 1, 0)
    return z


def from_lanes(z: np.ndarray, samples: int, horizon: int) -> np.ndarray:
    """Return perturbations sample by sample.  (samples, n_u, T)"""
    series, n_u, steps, _ = z.shape
    halves = steps // horizon
    rows = z.reshape(series, n_u, halves, horizon, LANES).transpose(0, 2, 4, 1, 3)
    return rows.reshape(-1, n_u, horizon)[:samples]
