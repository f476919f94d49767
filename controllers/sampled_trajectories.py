"""What the planner saw in its last iteration, for the eye: its best samples, the plan it chose and its cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.mppi import MPPI, Iteration, block_of
from controllers.plan import PlannerSnapshot
from controllers.rollout.lanes import CHUNK, LANES

MOST = LANES - 1  # samples; the plan takes the last lane of the block


@dataclass(frozen=True)
class SampledTrajectories:
    """Positions [m] over the horizon, the samples ranked by cost."""

    paths: np.ndarray  # (samples, points, 3) the cheapest first
    costs: np.ndarray  # (samples,) J
    nominal: np.ndarray  # (points, 3) of the plan after the update
    terms: dict[str, float]  # of the nominal's J, horizon means; they sum to J


def sampled_trajectories(mppi: MPPI, samples: int = MOST, points: int = 25) -> SampledTrajectories | None:
    """None before the first plan. Drawn and flown anew, which changes nothing that the planner uses."""
    if mppi.last is None:
        return None
    last = mppi.last
    best = cheapest(last.J, min(samples, MOST, len(last.J)))
    v = np.concatenate([controls(mppi, last, best), mppi.plan.T[None]])  # (samples + 1, n_u, T)
    paths, terms = mppi.rollout.paths(last.x, v, last.target)  # (samples + 1, T, 3), (samples + 1, n_terms)
    shown = np.linspace(0, len(mppi.plan) - 1, points).round().astype(int)
    names = mppi.rollout.cost.term_names
    return SampledTrajectories(
        paths[:-1, shown], last.J[best], paths[-1, shown], dict(zip(names, terms[-1].tolist(), strict=True))
    )


def controls(mppi: MPPI, last: Iteration, which: np.ndarray) -> np.ndarray:
    """v of these samples of the iteration.  (samples,) -> (samples, n_u, T)"""
    U, v = last.centre.T, np.empty((len(which), *last.centre.T.shape))
    for first in np.unique(which // CHUNK * CHUNK):
        z = mppi.perturbations(last, first, min(CHUNK, len(last.J) - first))
        for k in np.flatnonzero(which // CHUNK * CHUNK == first):
            m = which[k] - first
            v[k] = U + block_of(z, m // LANES, len(last.centre))[:, :, m % LANES]
    return np.clip(v, mppi.low[:, None], mppi.high[:, None])


def cheapest(J: np.ndarray, n: int) -> np.ndarray:
    """Indices of the n smallest, in order."""
    some = np.argpartition(J, n - 1)[:n]
    return some[np.argsort(J[some])]


def take_snapshot(mppi: MPPI, samples: int = 8, points: int = 16) -> PlannerSnapshot | None:
    """What a run keeps; the paths to the centimetre, which packs well."""
    seen = sampled_trajectories(mppi, samples, points)
    return None if seen is None else PlannerSnapshot(np.round(seen.paths, 2), seen.terms)
