"""The mean of a random series over each step of a rollout, as a sum of some numbers of the series.

A series that has no high frequencies is drawn at every r-th control period only. The mean over a
step is then estimated from the nearest numbers by the weights of the least mean square error
(Wiener's filter, with the covariance of the series), and multiplied by a factor so that it varies
as much as the mean does. If every period is drawn, the sum is the mean itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.controllers.steps import Steps

# Part of the largest eigenvalue of a covariance below which an eigenvalue counts as zero
RANK = 1e-9


class Sums(NamedTuple):
    """Weighted sums of a series z: row t of control c is sum_j parts[c, t, j] z[at[t, j]]."""

    at: np.ndarray  # (steps, terms) int32
    parts: np.ndarray  # (n_u, steps, terms) float32

    @property
    def terms(self) -> int:
        """The number of terms of each sum."""
        return self.at.shape[1]


# No sums: the rows are the series itself.
NO_SUMS = Sums(np.empty((0, 0), np.int32), np.empty((0, 0, 0), np.float32))


def sums_of_steps(power: np.ndarray, steps: Steps, halves: int, every: int) -> Sums:
    """Return the sums that are the means of a periodic series over the steps of its samples.

    Args:
        power: power of each frequency of the series, for each control  (n_u, n).
        steps: the steps of a sample.
        halves: number of samples in the series, one after the other.
        every: r, the number of control periods from one drawn number to the next; it divides n.
    """
    n = power.shape[1]
    covariance = np.fft.fft(power).real  # of two numbers, by the periods between them  (n_u, n)

    # The periods of the terms, from the last one drawn before a step. If not all periods are drawn,
    # one more number on either side is used.
    longest = int(steps.lengths.max())
    around = 1 if every > 1 else 0
    terms = (every + longest - 2) // every + 1 + 2 * around
    drawn = every * (np.arange(terms) - around)
    of_drawn = covariance[:, drawn[:, None] - drawn]  # (n_u, terms, terms)
    inverse = np.linalg.pinv(of_drawn, rcond=RANK, hermitian=True)

    def parts_of(begin: int, length: int) -> np.ndarray:
        """Return the parts for a step that begins some periods after a number.  (n_u, terms)"""
        within = begin + np.arange(length)
        with_mean = covariance[:, drawn[:, None] - within].mean(axis=2)  # (n_u, terms)
        of_mean = covariance[:, within[:, None] - within].mean(axis=(1, 2))  # (n_u,)
        parts = np.einsum("cij,cj->ci", inverse, with_mean)
        of_sum = np.einsum("ci,cij,cj->c", parts, of_drawn, parts)
        return parts * np.sqrt(of_mean / of_sum)[:, None]

    # Steps that begin alike after a number, and last alike, have the same parts.
    firsts = np.concatenate([half * steps.periods + steps.firsts for half in range(halves)])
    lengths = np.tile(steps.lengths, halves)
    kinds = list(zip((firsts % every).tolist(), lengths.tolist(), strict=True))
    found = {kind: parts_of(*kind) for kind in set(kinds)}
    parts = np.stack([found[kind] for kind in kinds], axis=1)
    at = (firsts[:, None] // every + np.arange(terms) - around) % (n // every)
    return Sums(at.astype(np.int32), parts.astype(np.float32))
