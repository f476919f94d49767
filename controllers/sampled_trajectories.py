"""The planner's last iteration for display: its best samples, the updated plan and the terms of the
plan's cost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.lanes.layout import LANES, chunks, sample
from controllers.mppi import MPPI, Iteration
from controllers.plan import PlannerSnapshot

MOST = LANES - 1  # samples; the updated plan takes the last lane of the block


@dataclass(frozen=True)
class SampledTrajectories:
    """Positions [m] over the horizon, the samples ranked by cost."""

    paths: np.ndarray  # (samples, points, 3) least cost first
    costs: np.ndarray  # (samples,) J
    plan: np.ndarray  # (points, 3) of the updated plan
    terms: dict[str, float]  # cost of the updated plan by term, horizon means that sum to its J


def sampled_trajectories(
    mppi: MPPI, samples: int = MOST, points: int = 25
) -> SampledTrajectories | None:
    """The samples are drawn and rolled out again, which does not change the planner. None before
    the first plan."""
    if mppi.last is None:
        return None
    last = mppi.last
    best = np.argsort(last.J)[: min(samples, MOST)]
    v = np.concatenate([controls(mppi, last, best), mppi.plan.T[None]])  # (samples + 1, n_u, T)
    # (samples + 1, T, 3), (samples + 1, n_terms)
    paths, terms = mppi.rollout.paths(last.x, v, last.target)
    shown = np.linspace(0, len(mppi.plan) - 1, points).round().astype(int)
    names = mppi.rollout.cost.term_names
    return SampledTrajectories(
        paths[:-1, shown],
        last.J[best],
        paths[-1, shown],
        dict(zip(names, terms[-1].tolist(), strict=True)),
    )


def controls(mppi: MPPI, last: Iteration, which: np.ndarray) -> np.ndarray:
    """The controls v of the samples with these indices.  (samples,) -> (samples, n_u, T)"""
    U, v = last.nominal.T, np.empty((len(which), *last.nominal.T.shape))
    for chunk in chunks(len(last.J)):
        inside = np.flatnonzero((which >= chunk.start) & (which < chunk.stop))
        if len(inside):
            z = mppi.perturbations(last, chunk)
        for k in inside:
            v[k] = U + mppi.ramp[which[k] // LANES % 2] * sample(
                z, which[k] - chunk.start, len(last.nominal)
            )
    return np.clip(v, mppi.low[:, None], mppi.high[:, None])


def take_snapshot(mppi: MPPI, samples: int = 8, points: int = 16) -> PlannerSnapshot | None:
    """The snapshot that is stored with a run; paths rounded to a centimetre, which compresses
    well."""
    seen = sampled_trajectories(mppi, samples, points)
    return None if seen is None else PlannerSnapshot(np.round(seen.paths, 2), seen.terms)
