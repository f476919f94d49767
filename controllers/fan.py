"""What the planner saw in its last iteration, for the eye: its best samples, the plan it chose and its cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.mppi import MPPI, block_of
from controllers.rollout.lanes import LANES

MOST = LANES - 1  # samples; the plan takes the last lane of the block


@dataclass(frozen=True)
class Fan:
    """Positions [m] over the horizon, the samples ranked by cost."""

    paths: np.ndarray  # (samples, points, 3) the cheapest first
    costs: np.ndarray  # (samples,) J
    nominal: np.ndarray  # (points, 3) of the plan after the update
    terms: dict[str, float]  # of the nominal's J, horizon means; they sum to J


def fan(mppi: MPPI, samples: int = MOST, points: int = 25) -> Fan | None:
    """None before the first plan. Flown anew in one block of lanes: .2 ms, and nothing the planner uses changes."""
    if mppi.last is None:
        return None
    x, U, z, J, target = mppi.last
    best = cheapest(J, min(samples, MOST, len(J)))
    v = np.empty((len(best) + 1, U.shape[1], len(U)), z.dtype)  # (samples + 1, n_u, T)
    for i, m in enumerate(best):
        v[i] = np.clip(U.T + block_of(z, m // LANES, len(U))[:, :, m % LANES], mppi.low[:, None], mppi.high[:, None])
    v[-1] = mppi.plan.T
    paths, terms = mppi.rollout.paths(x, v, target)  # (samples + 1, T, 3), (samples + 1, n_terms)
    shown = np.linspace(0, len(U) - 1, points).round().astype(int)
    names = mppi.rollout.cost.term_names
    return Fan(paths[:-1, shown], J[best], paths[-1, shown], dict(zip(names, terms[-1].tolist(), strict=True)))


def cheapest(J: np.ndarray, n: int) -> np.ndarray:
    """Indices of the n smallest, in order."""
    some = np.argpartition(J, n - 1)[:n]
    return some[np.argsort(J[some])]


def best_paths(mppi: MPPI, samples: int = 8, points: int = 16) -> np.ndarray | None:
    """What a run keeps, to the centimetre, which packs well: positions [m] of the best samples.  (8, 16, 3)"""
    seen = fan(mppi, samples, points)
    return None if seen is None else np.round(seen.paths, 2)
