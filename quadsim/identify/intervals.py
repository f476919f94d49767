"""Intervals: the uncertainty of the fitted numbers.

Two covariances are compared. The Jacobian's takes residuals as independent,

    C = (J' W J + P)^-1,

with the robust weights W and the precision P of the prior. Real residuals are not independent: a
gust pushes for a second. So pieces of a second are drawn with replacement (bootstrap), each draw
taking one Gauss-Newton step from the solution. The larger of the two deviations is reported.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.identify.descent import normal_equations
from quadsim.identify.search import Linearized

DRAWS = 400
SEED = 0  # of the bootstrap's draws: the same log gives the same intervals
LEAST_SPREAD = 1e-9  # deviation of the draws, over the reported one, below which it is nothing
TWO_SIDED = 1.96  # standard deviations of a 95 % interval


class Covariances(NamedTuple):
    """The covariance of the searched numbers, in two ways and together."""

    jacobian: np.ndarray  # (k, k)
    bootstrap: np.ndarray  # (k, k)
    reported: np.ndarray  # the larger deviations, with the bootstrap's correlations  (k, k)
    # standard deviation of each number by the log alone, without the prior  (k,)
    log_alone: np.ndarray


def covariances(solution: Linearized) -> Covariances:
    """Return the covariances of the numbers of a solution."""
    J = solution.jacobian
    r = solution.values
    clusters, index = np.unique(solution.cluster, return_inverse=True)
    k = J.shape[1]
    H = np.zeros((len(clusters), k, k))
    g = np.zeros((len(clusters), k))
    order = np.argsort(index, kind="stable")
    bounds = np.searchsorted(index[order], np.arange(len(clusters) + 1))
    for c in range(len(clusters)):
        rows = order[bounds[c] : bounds[c + 1]]
        H[c], g[c] = normal_equations(J[rows], r[rows])

    P = np.diag(solution.prior_precision)
    total = H.sum(axis=0)
    by_jacobian = np.linalg.pinv(total + P, hermitian=True)
    by_bootstrap = _bootstrap(H, g, P)
    spread = _deviations(by_bootstrap)
    deviations = np.maximum(_deviations(by_jacobian), spread)
    # A number on which no residual depends is as uncertain as its prior.
    depends = spread > LEAST_SPREAD * deviations
    scale = np.divide(deviations, spread, out=np.zeros_like(spread), where=depends)
    reported = by_bootstrap * np.outer(scale, scale) + np.diag(
        np.where(depends, 0.0, deviations**2)
    )
    alone = np.linalg.pinv(total + 1e-12 * np.diag(np.diag(total)) + 1e-9 * P, hermitian=True)
    return Covariances(
        jacobian=by_jacobian,
        bootstrap=by_bootstrap,
        reported=reported,
        log_alone=np.maximum(_deviations(alone), spread),
    )


def _bootstrap(H: np.ndarray, g: np.ndarray, P: np.ndarray) -> np.ndarray:
    """Return the covariance of one Gauss-Newton step over drawn clusters  (k, k).

    Args:
        H: J' W J of each cluster  (c, k, k).
        g: J' W r of each cluster  (c, k).
        P: precision of the prior  (k, k).
    """
    count = len(H)
    rng = np.random.default_rng(SEED)
    drawn = rng.multinomial(count, np.full(count, 1.0 / count), size=DRAWS)
    # At the solution the clusters' gradients add up to the prior's alone, which is left out.
    g = g - g.mean(axis=0)
    # einsum: BLAS would start threads, see quadsim.identify.products
    H_drawn = np.einsum("dc,cij->dij", drawn.astype(float), H) + P
    g_drawn = drawn @ g
    steps = np.linalg.solve(H_drawn, g_drawn[..., None])[..., 0]
    return np.cov(steps, rowvar=False).reshape(H.shape[1:])


def _deviations(covariance: np.ndarray) -> np.ndarray:
    return np.sqrt(np.maximum(np.diag(covariance), 0.0))
