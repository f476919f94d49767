"""How samples lie in memory: perturbations z of shape (series, n_u, halves * T, LANES).

LANES samples stand side by side, one in each lane of the vector code, and make a block. A series
holds one block of T steps, or two blocks (halves) one after the other in time, as one Fourier
transform of length 2 T yields two samples. Sample m is lane m % LANES of block m // LANES. One
number a sample, such as a cost or weight, lies in (blocks, LANES).

At most CHUNK samples are held at a time, whole blocks of whole series, so that they stay in the
processor's caches.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

LANES = 64
CHUNK = 2048  # samples: 5 MB of perturbations at the paper's horizon


def blocks(samples: int) -> int:
    """How many blocks hold so many samples."""
    return -(-samples // LANES)


def chunks(samples: int) -> Iterator[slice]:
    """The samples in parts of at most CHUNK."""
    return (slice(first, min(first + CHUNK, samples)) for first in range(0, samples, CHUNK))


def mean_of_chunks(means: Sequence[np.ndarray], weights: np.ndarray) -> np.ndarray:
    """The weighted mean over all samples (M,) from that of each chunk: each counts with its share
    of the weight."""
    firsts = [part.start for part in chunks(len(weights))]
    return np.tensordot(np.add.reduceat(weights, firsts), means, axes=1)


def in_blocks(numbers: np.ndarray) -> np.ndarray:
    """One number a sample, zeros where the last block has no sample.  (M,) -> (blocks, LANES)"""
    padded = np.zeros(blocks(len(numbers)) * LANES)
    padded[: len(numbers)] = numbers
    return padded.reshape(-1, LANES)


def block(z: np.ndarray, b: int, horizon: int) -> np.ndarray:
    """Block b, a view.  (n_u, T, LANES)"""
    halves = z.shape[2] // horizon
    t0 = (b % halves) * horizon
    return z[b // halves, :, t0 : t0 + horizon]


def sample(z: np.ndarray, m: int, horizon: int) -> np.ndarray:
    """Sample m, a view.  (n_u, T)"""
    return block(z, m // LANES, horizon)[:, :, m % LANES]


def first_steps(z: np.ndarray, horizon: int) -> np.ndarray:
    """The first step of every sample, a view.  (series, n_u, halves, LANES)"""
    return z[:, :, ::horizon]


def add_from(z: np.ndarray, first: int, samples: int, offset: np.ndarray) -> None:
    """Add to each sample from number `first` on the offset of its block, even or odd.  offset (2,
    T, n_u)"""
    for b in range(first // LANES, blocks(samples)):
        block(z, b, offset.shape[1])[:, :, max(first - b * LANES, 0) :] += offset[b % 2].T[
            :, :, None
        ]


def in_lanes(rows: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Fill z (blocks, n_u, T, LANES) with one row a sample, and zeros where there is none.  rows
    (samples, T, n_u)"""
    z[-1] = 0
    for b, lanes in enumerate(np.split(rows, range(LANES, len(rows), LANES))):
        z[b, :, :, : len(lanes)] = lanes.transpose(2, 1, 0)
    return z


def from_lanes(z: np.ndarray, samples: int, horizon: int) -> np.ndarray:
    """One row a sample.  -> (samples, n_u, T)"""
    series, n_u, steps, _ = z.shape
    rows = z.reshape(series, n_u, steps // horizon, horizon, LANES).transpose(0, 2, 4, 1, 3)
    return rows.reshape(-1, n_u, horizon)[:samples]
