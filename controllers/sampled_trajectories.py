"""Trajectories for display: the best samples of the last iteration, and the updated plan."""

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
    """Draw the best samples of the last iteration and roll them out again.

    The planner does not change.

    Args:
        mppi: the planner.
        samples: number of samples, at most MOST.
        points: number of points of each path.

    Returns:
        The trajectories; None before the first plan.
    """
    last = mppi.last
    if last is None:
        return None

    # The best samples, and behind them the updated plan
    best = np.argsort(last.J)[: min(samples, MOST)]
    plan = mppi.plan.T[None]  # (1, n_u, T)
    v = np.concatenate([controls(mppi, last, best), plan])  # (samples + 1, n_u, T)

    # Positions (samples + 1, T, 3) and terms (samples + 1, n_terms)
    paths, terms = mppi.rollout.paths(last.x, v, last.target)
    shown = np.linspace(0, len(mppi.plan) - 1, points).round().astype(int)
    names = mppi.rollout.cost.term_names
    return SampledTrajectories(
        paths=paths[:-1, shown],
        costs=last.J[best],
        plan=paths[-1, shown],
        terms=dict(zip(names, terms[-1].tolist(), strict=True)),
    )


def controls(mppi: MPPI, last: Iteration, which: np.ndarray) -> np.ndarray:
    """Return the controls v of some samples.

    Args:
        mppi: the planner.
        last: the iteration that the samples belong to.
        which: indices of the samples  (samples,).

    Returns:
        (samples, n_u, T)
    """
    U = last.nominal.T  # (n_u, T)
    T = len(last.nominal)
    v = np.empty((len(which), *U.shape))
    for chunk in chunks(len(last.J)):
        inside = np.flatnonzero((which >= chunk.start) & (which < chunk.stop))
        if not len(inside):
            continue
        z = mppi.perturbations(last, chunk)
        for k in inside:
            m = which[k]
            ramp = mppi.ramp[m // LANES % 2]  # of even and odd blocks  (T,)
            v[k] = U + ramp * sample(z, m - chunk.start, T)
    return np.clip(v, mppi.low[:, None], mppi.high[:, None])


def take_snapshot(mppi: MPPI, samples: int = 8, points: int = 16) -> PlannerSnapshot | None:
    """Return the snapshot that is stored with a run, None before the first plan.

    Paths are rounded to a centimetre, which compresses well.

    Args:
        mppi: the planner.
        samples: number of samples.
        points: number of points of each path.
    """
    seen = sampled_trajectories(mppi, samples, points)
    if seen is None:
        return None
    return PlannerSnapshot(best=np.round(seen.paths, 2), terms=seen.terms)
