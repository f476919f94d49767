"""Trajectories for display: the best samples of the last iteration, and the updated plan."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from quadsim.controllers.costs import Cost, StateTerm, evaluate
from quadsim.controllers.lanes.lanes import Rollout, Trajectories
from quadsim.controllers.lanes.layout import LANES, chunks, sample
from quadsim.controllers.lanes.planner_loops import term_steps
from quadsim.controllers.mppi import MPPI, Iteration
from quadsim.controllers.plan import PlannerSnapshot
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.expected_path import ExpectedPath

MOST = LANES - 1  # samples; the updated plan takes the last lane of the block


@dataclass(frozen=True)
class SampledTrajectories:
    """The positions [m] of samples over the horizon, ranked by cost."""

    paths: np.ndarray  # (samples, points, 3) least cost first
    costs: np.ndarray  # (samples,) J
    plan: np.ndarray  # (points, 3) of the updated plan
    terms: dict[str, float]  # cost of the updated plan by term, horizon means that sum to its J


def sampled_trajectories(
    mppi: MPPI, samples: int = MOST, points: int = 25
) -> SampledTrajectories | None:
    """Return the best samples of the last iteration, which are drawn and rolled out again.

    The planner is not changed.

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

    # The best samples, followed by the updated plan
    best = np.argsort(last.J)[: min(samples, MOST)]
    plan = mppi.steps.mean(mppi.plan).T[None]  # (1, n_u, T)
    v = np.concatenate([controls(mppi, last, best), plan])  # (samples + 1, n_u, T)

    found = mppi.rollout.trajectories(last.x, v, last.target)
    # The steps in which these control periods lie
    periods = np.linspace(0, len(mppi.plan) - 1, points).round()
    shown = np.searchsorted(mppi.steps.ends, periods, side="right")
    paths = found.states[:, shown, :3]
    return SampledTrajectories(
        paths=paths[:-1],
        costs=last.J[best],
        plan=paths[-1],
        terms=terms_of(mppi.rollout, last.x, plan[0], last.target, found.sample(-1)),
    )


def terms_of(
    rollout: Rollout, x0: np.ndarray, v: np.ndarray, target: int, found: Trajectories
) -> dict[str, float]:
    """Return the horizon mean of each term of the cost along a trajectory, by name.

    The compiled loops return only the sum of all terms. The terms are therefore computed again
    here, on arrays over all steps, by the functions that the loops inline.

    Args:
        rollout: the rollout.
        x0: state  (n_x,).
        v: controls  (n_u, T).
        target: number of targets reached.
        found: the trajectory of these controls, a single sample.
    """
    system, d = rollout.system, rollout.dtype
    cost = rollout.cost.with_numbers(rollout.given).over(rollout.schedule.lengths)
    T = v.shape[1]
    before = np.vstack([x0.astype(d), found.states[:-1]])
    u = np.clip(v, np.array(system.low)[:, None], np.array(system.high)[:, None])
    rows = cost.targets_from(target, x0, d)[found.rows]

    # Overflows are silent here, as in the loops.
    with np.errstate(all="ignore"):
        stage = evaluate(
            _terms_alone(cost),
            system.state(*before.T),
            system.state(*found.states.T),
            system.control(*u.astype(d)),
            tuple(rows.T),
            found.crashed,
            np.arange(T),
        )
    weights = rollout.schedule.cost(T)
    means = dict.fromkeys(cost.term_names, 0.0)
    for name, value in stage.terms.items():
        means[name] = float(np.mean(weights * value))
    means |= state_terms(rollout, cost, found.states, rows)

    # A crash into an obstacle is found some steps late, and the loops then charge the weight of
    # crashes for each of these steps. So this cost is the difference of J to the sum of the terms,
    # up to rounding.
    if cost.obstacles is not None:
        crash = cost.terms[cost.crash_term]
        periods = int(rollout.schedule.periods(T).sum())
        beyond = (float(found.J) - sum(means.values())) * periods
        weight = float(crash.weight)
        if weight and isfinite(beyond):
            late = max(round(beyond / weight), 0)
            means[crash.name] += late * weight / periods
    return means


def state_terms(
    rollout: Rollout, cost: Cost, states: np.ndarray, rows: np.ndarray
) -> dict[str, float]:
    """Return the horizon mean of each term of the state alone, by name.

    Args:
        rollout: the rollout.
        cost: its cost, with the numbers that are used.
        states: after each step  (T, n_x).
        rows: the target row of each step  (T, n_target).
    """
    # The target after a step is the target of the next one.
    after = np.vstack([rows[1:], rows[-1:]])
    x = rollout.system.state(*states.T)
    target = cost.row._make(after.T)
    marks = rollout.schedule.marks(len(states), term_steps(rollout.system.dt))
    means = {}
    for term in cost.terms:
        if isinstance(term, StateTerm) and np.any(term.weight):
            with np.errstate(all="ignore"):
                value = term.value(x, x, None, target, term.parameters or cost.params)
            means[term.name] = float(np.mean(marks * term.weight * value))
    return means


def _terms_alone(cost: Cost) -> Cost:
    """Return a cost with the terms of nonzero weight, without crashes and targets.

    Terms of the state are left out, too. Terms of weight zero may have infinite values or nan; the
    loops leave them out as well.
    """
    terms = tuple(
        term for term in cost.terms if np.any(term.weight) and not isinstance(term, StateTerm)
    )
    return replace(cost, terms=terms, reached=None, crash=None, risk=None)


def controls(mppi: MPPI, last: Iteration, which: np.ndarray) -> np.ndarray:
    """Return the controls v of some samples.

    Args:
        mppi: the planner.
        last: the iteration of the samples.
        which: indices of the samples  (samples,).

    Returns:
        The controls  (samples, n_u, T).
    """
    U = last.nominal.T  # (n_u, T)
    v = np.empty((len(which), *U.shape))
    for chunk in chunks(len(last.J)):
        inside = np.flatnonzero((which >= chunk.start) & (which < chunk.stop))
        if not len(inside):
            continue
        z = mppi.perturbations(last, chunk)
        for k in inside:
            m = which[k]
            ramp = mppi.ramp[m // LANES % 2]  # factors of even and odd blocks  (T,)
            v[k] = U + ramp * sample(z, m - chunk.start, len(last.nominal))
    return np.clip(v, mppi.low[:, None], mppi.high[:, None])


def take_snapshot(mppi: MPPI, samples: int = 8, points: int = 16) -> PlannerSnapshot | None:
    """Return the snapshot for the record of a run, None before the first plan.

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


def planned_path(planner: MPPI, estimate: Estimate) -> ExpectedPath:
    """Return the path of a planner's present plan, in the time of the race.

    Args:
        planner: the planner.
        estimate: the estimate from which it has planned.
    """
    v = planner.clipped(planner.steps.mean(planner.plan)).T[None]  # (1, n_u, T)
    found = planner.rollout.trajectories(estimate.x, v, estimate.target)
    positions = np.vstack([estimate.x[:3], found.states[0, :, :3]])  # (T + 1, 3)
    ends = np.append(0, planner.steps.ends)
    if len(positions) <= ends[-1]:
        periods = np.arange(ends[-1] + 1)
        along = [np.interp(periods, ends, coordinate) for coordinate in positions.T]
        positions = np.stack(along, axis=1)  # (periods + 1, 3)
    return ExpectedPath(estimate.begins, planner.config.dt, positions.astype(float))
