"""The float64 oracle of the compiled lanes: the same step() and terms(), flown on numpy rows of all samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.costs import Cost
from controllers.rollout.lanes import LANES
from quadsim.systems import System


@dataclass(frozen=True)
class Flown:
    """What the oracle saw of M samples."""

    J: np.ndarray  # (M,) horizon mean of the cost
    reached: np.ndarray  # (M,) targets reached
    crashed: np.ndarray  # (M,) 0.0 or 1.0
    clearance: np.ndarray  # (M,) least distance of a discrete decision to its other outcome, see `decision_distance`


def fly_rows(system: System, cost: Cost, x0, U, z, target: int = 0, clearance=None) -> Flown:
    """Fly v = clip(U + z) from x0.  U (T, n_u), z (M, n_u, T)

    clearance(x, x_next, aim, params) -> (M,): how far this step's decisions are from turning out otherwise.
    """
    M, T = len(z), len(U)
    aims = cost.aims_from(target, np.asarray(x0), np.float64)
    x = tuple(np.full(M, value, float) for value in x0)
    row, crashed, total, clear = np.zeros(M, int), np.zeros(M), np.zeros(M), np.full(M, np.inf)
    for t in range(T):
        u = tuple(np.clip(U[t, k] + z[:, k, t], system.low[k], system.high[k]) for k in range(U.shape[1]))
        x_next = system.step(x, u, system.params, system.dt)
        aim = tuple(aims[row].T)
        *q, reached, crashed = cost.terms(x, x_next, u, aim, crashed, cost.params)
        if clearance is not None:
            clear = np.minimum(clear, clearance(x, x_next, aim, cost.params))
        total += sum(q)
        row = np.minimum(row + reached, len(aims) - 1)
        x = x_next
    return Flown(total / T, row, crashed, clear)


def decision_distance(x, x_next, aim, params) -> np.ndarray:
    """Distance of a step to the surfaces where the racing cost jumps [m].  (M,)

    Those are the gate's plane at the end of the step, the edges of opening and frame where the plane is
    crossed, the bounds, and the ball around the gate's centre in which heading and waypoint switch.
    """
    g, n, left = (np.array(aim[i : i + 3]) for i in (0, 3, 6))
    edges, box = np.array(aim[9:13]), params[10:]
    before, after = np.array(x[:3]) - g, np.array(x_next[:3]) - g
    s0, s1 = (before * n).sum(axis=0), (after * n).sum(axis=0)
    crosses = s0 * s1 <= 0.0
    hit = after + (before - after) * np.where(crosses, s1 / np.where(crosses, s1 - s0 + 1e-300, 1.0), 0.0)
    across = np.abs([(hit * left).sum(axis=0), (hit * np.cross(n, left, axis=0)).sum(axis=0)] * 2)
    to_edges = np.where(crosses, np.abs(across - edges).min(axis=0), np.inf)
    px, py, pz = x_next[:3]
    to_box = np.abs([pz - box[0], px - box[1], px - box[2], py - box[3], py - box[4], pz - box[5]]).min(axis=0)
    r = np.sqrt((after * after).sum(axis=0))
    to_balls = np.abs([r - 0.5, r - params[9]]).min(axis=0)
    return np.minimum.reduce([np.abs(s1), to_edges, to_box, to_balls])


def to_lanes(z: np.ndarray, halves: int = 1, dtype: type = np.float32) -> np.ndarray:
    """Samples in the samplers' layout; missing lanes are zero.  (M, n_u, T) -> (series, n_u, halves * T, LANES)"""
    M, n_u, T = z.shape
    series = -(-M // (LANES * halves))
    full = np.zeros((series * halves * LANES, n_u, T), dtype)
    full[:M] = z
    return np.ascontiguousarray(
        full.reshape(series, halves, LANES, n_u, T).transpose(0, 3, 1, 4, 2).reshape(series, n_u, halves * T, LANES)
    )


def from_lanes(z: np.ndarray, samples: int, horizon: int) -> np.ndarray:
    """The inverse of `to_lanes`: sample m of the samplers' layout.  -> (M, n_u, T)"""
    series, n_u, steps, lanes = z.shape
    halves = steps // horizon
    rows = z.reshape(series, n_u, halves, horizon, lanes).transpose(0, 2, 4, 1, 3)
    return rows.reshape(-1, n_u, horizon)[:samples]
