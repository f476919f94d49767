"""The planner's last iteration, for display: its best samples, the plan after the update and the terms of its cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.mppi import MPPI, Iteration
from controllers.plan import PlannerSnapshot
from controllers.rollout.layout import LANES, chunks, sample

MOST = LANES - 1  # samples; the plan takes the last lane of the block


@dataclass(frozen=True)
class SampledTrajectories:
    """Positions [m] over the horizon, the samples ranked by cost."""

    paths: np.ndarray  # (samples, points, 3) the cheapest first
    costs: np.ndarray  # (samples,) J
    nominal: np.ndarray  # (points, 3) of the plan after the update
    terms: dict[str, float]  # of the nominal's J, horizon means; they sum to J


def sampled_trajectories(mppi: MPPI, samples: int = MOST, points: int = 25) -> SampledTrajectories | None:
    """None before the first plan. Drawn and rolled out anew, which changes nothing that the planner uses."""
    if mppi.last is None:
        return None
    last = mppi.last
    best = np.argsort(last.J)[: min(samples, MOST)]
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
    for chunk in chunks(len(last.J)):
        inside = np.flatnonzero((which >= chunk.start) & (which < chunk.stop))
        if len(inside):
            z = mppi.perturbations(last, chunk)
        for k in inside:
            v[k] = U + sample(z, which[k] - chunk.start, len(last.centre))
    return np.clip(v, mppi.low[:, None], mppi.high[:, None])


def take_snapshot(mppi: MPPI, samples: int = 8, points: int = 16) -> PlannerSnapshot | None:
    """What a run keeps; the paths rounded to a centimetre, which compresses well."""
    seen = sampled_trajectories(mppi, samples, points)
    return None if seen is None else PlannerSnapshot(np.round(seen.paths, 2), seen.terms)
