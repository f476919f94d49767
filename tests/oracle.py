"""The float64 oracle of the compiled lanes: the same functions on NumPy rows of all samples."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from quadsim.controllers.costs import Cost, Obstacles, StateTerm, evaluate
from quadsim.controllers.lanes.layout import LANES
from quadsim.controllers.lanes.planner_loops import MARKS, steps_between, term_steps
from quadsim.controllers.schedule import Schedule, marks_at
from quadsim.dynamics import System

SAME = Schedule()  # every step alike
GRAZE = 1e-4  # [m] by which float32 may judge otherwise whether a line touches a frame


@dataclass(frozen=True)
class Flown:
    """The flights of M samples."""

    J: np.ndarray  # (M,) horizon mean of the cost
    reached: np.ndarray  # (M,) targets reached
    crashed: np.ndarray  # (M,) 0.0 or 1.0
    # (M,) least distance of a discrete decision to its other outcome, see `decision_distance`
    clearance: np.ndarray
    terms: np.ndarray  # (M, n_terms) horizon mean of each term


def fly_rows(
    system: System, cost: Cost, x0, U, z, target: int = 0, clearance=None, schedule=SAME
) -> Flown:
    """Fly v_t = clip(U_t + n_t z_t) from x0.

    Args:
        system: the model.
        cost: the cost.
        x0: state  (n_x,).
        U: plan  (T, n_u).
        z: perturbations  (M, n_u, T).
        target: number of targets reached.
        clearance: (x, x_next, target, params) -> (M,), how far a step's decisions are from turning
            out otherwise.
        schedule: the steps, and the weights n_t and s_t along the horizon.
    """
    M, T = len(z), len(U)
    periods = schedule.periods(T)
    systems = [system.over(length) for length in periods.tolist()]
    cost = cost.over(schedule.lengths)
    noise = schedule.noise(T)
    stage = schedule.cost(T)
    marks = schedule.marks(T, term_steps(system.dt))
    odd = np.arange(M) // LANES % 2
    targets = cost.targets_from(target, np.asarray(x0), np.float64)
    x = system.state(*(np.full(M, value, float) for value in x0))
    row = np.zeros(M, int)
    crashed = np.zeros(M)
    clear = np.full(M, np.inf)
    total = np.zeros((len(cost.term_names), M))
    lines = None
    if cost.obstacles is not None:
        lines = Lines(cost, cost.obstacles, x0, periods, system.dt, row < len(targets) - 1)
    for t in range(T):
        u = system.control(
            *(
                np.clip(U[t, k] + noise[odd, t] * z[:, k, t], system.low[k], system.high[k])
                for k in range(U.shape[1])
            )
        )
        x_next = systems[t].next(x, u)
        gate = cost.row._make(targets[row].T)
        found = evaluate(cost, x, x_next, u, gate, crashed, t)
        crashed = found.crashed
        if clearance is not None:
            clear = np.minimum(clear, clearance(x, x_next, gate, cost.params))
        total += stage[t] * np.array([np.broadcast_to(value, M) for value in found.terms.values()])
        row = np.minimum(row + found.reached, len(targets) - 1)
        x = x_next
        # Terms of the state alone count at marks only, with the target after the step.
        after = evaluate(cost, x, x, u, cost.row._make(targets[row].T), crashed, t).terms
        for k, term in enumerate(cost.terms):
            if isinstance(term, StateTerm):
                total[k] += marks[t] * after[term.name] - stage[t] * found.terms[term.name]
        if lines is not None:
            near = lines.meet(t, np.array(x[:3]), crashed, total, row < len(targets) - 1)
            clear = np.minimum(clear, near) if clearance is not None else clear
    return Flown(total.sum(axis=0) / T, row, crashed, clear, total.T / T)


class Lines:
    """The lines that the lanes test against obstacles.

    They lie between positions `stride` control periods apart, MARKS at a time.
    """

    def __init__(self, cost: Cost, obstacles: Obstacles, x0, periods, dt: float, unfinished):
        self.T = len(periods)
        self.stride = steps_between(dt)
        self.ends = marks_at(periods, self.stride)
        self.unfinished = unfinished
        self.obstacles = obstacles
        self.marked = [np.repeat(np.array(x0[:3])[:, None], len(unfinished), axis=1)]  # (3, M) each
        self.rows = obstacles.near(np.asarray(x0), periods.sum() * dt)
        self.term = cost.crash_term
        self.weight = cost.terms[self.term].weight * self.T / periods.sum()

    def meet(self, t, p, crashed, total, unfinished):
        """Latch crashes and add their cost.

        Returns:
            Distance of each sample's decisions from turning out otherwise [m]  (M,)
        """
        least = np.full(len(crashed), np.inf)
        end = t == self.T - 1
        if t in self.ends:
            # At the end the last position fills what is left.
            self.marked += [p] * (MARKS - len(self.marked) if end else 1)
        if len(self.marked) < MARKS:
            return least
        for numbers in self.rows:
            row = self.obstacles.row(*numbers)
            for m, (a, b) in enumerate(pairwise(self.marked), 1):
                touched = self.obstacles.touches(a, b, row)
                new = touched & self.unfinished
                added = np.where(new, np.maximum(1.0 - crashed, 0.0), 0.0)
                due = (MARKS - 1 - m) * self.stride + 1
                total[self.term] += self.weight * due * added
                crashed += added
                least = np.minimum(least, line_distance(a, b, row, self.obstacles.touches))
        self.marked = [p]
        self.unfinished = unfinished
        return least


def line_distance(a, b, row, touches) -> np.ndarray:
    """Return about how far a line is from touching a grown slab, or from missing it [m].  (M,)"""
    found = []
    for e in (-GRAZE, 0.0, GRAZE):
        grown = row._replace(
            half=row.half + e,
            free_y=row.free_y - e,
            free_z=row.free_z - e,
            out_y=row.out_y + e,
            out_z=row.out_z + e,
            radius2=(e + row.radius2**0.5) ** 2,
        )
        found.append(touches(a, b, grown))
    low, here, high = found
    return np.where((low == here) & (here == high), np.inf, 0.0)


def decision_distance(x, x_next, target, params) -> np.ndarray:
    """Distance of a step to the surfaces where the racing cost jumps [m].  (M,)

    Those are the gate's entry and exit planes at either end of the step, the edges of opening and
    frame where the step crosses a plane or ends between them, the bounds, and the balls in which
    heading and waypoint switch.
    """
    g = np.array((target.x, target.y, target.z))
    n = np.array((target.nx, target.ny, target.nz))
    left = np.array((target.lx, target.ly, target.lz))
    depth = target.depth
    before, after = np.array(x[:3]) - g, np.array(x_next[:3]) - g
    s0, s1 = (before * n).sum(axis=0), (after * n).sum(axis=0)
    nearest = [abs(s) for s in (s0, s1, s0 + depth, s1 + depth)]
    for plane in (0.0, -depth):
        crosses = (s0 < plane) != (s1 < plane)
        share = (s1 - plane) / np.where(crosses, s1 - s0, 1.0)
        nearest.append(
            np.where(crosses, to_edges(after + (before - after) * share, n, left, target), np.inf)
        )
    nearest.append(np.where((s1 > -depth) & (s1 < 0.0), to_edges(after, n, left, target), np.inf))
    px, py, pz = x_next[:3]
    p = params
    box = (p.floor, p.x_low, p.x_high, p.y_low, p.y_high, p.z_high)
    nearest += [abs(a - b) for a, b in zip((pz, px, px, py, py, pz), box, strict=True)]
    r = np.sqrt((after * after).sum(axis=0))
    return np.minimum.reduce([*nearest, abs(r - 0.5), abs(r - p.waypoint_radius)])


def to_edges(p, n, left, target) -> np.ndarray:
    """Distance of points p (3, M), off a gate's exit, to the edges of its free opening and of its
    frame [m].  (M,)"""
    free_y, free_z, bar = target.free_y, target.free_z, target.bar
    across, up = (p * left).sum(axis=0), (p * np.cross(n, left, axis=0)).sum(axis=0)
    beside = np.maximum(abs(across) - free_y, abs(up) - free_z)
    return np.minimum(abs(beside), abs(beside - bar))


def to_lanes(z: np.ndarray, halves: int = 1, dtype: type = np.float32) -> np.ndarray:
    """Return samples (M, n_u, T) in the samplers' layout; missing lanes are zero.

    Returns:
        (series, n_u, halves * T, LANES)
    """
    M, n_u, T = z.shape
    series = -(-M // (LANES * halves))
    full = np.zeros((series * halves * LANES, n_u, T), dtype)
    full[:M] = z
    return np.ascontiguousarray(
        full.reshape(series, halves, LANES, n_u, T)
        .transpose(0, 3, 1, 4, 2)
        .reshape(series, n_u, halves * T, LANES)
    )
