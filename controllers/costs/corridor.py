"""The off-road cost on flat ground: the terms of Vlahov et al. 2024, section IV-A, that make sense there.

    q = a_0 CostToGo + d (a_1 Lethal + a_2 Rollover + a_3 Speed),    d = v dt

The risks count by the metre travelled, so standing still is safe. The other terms of the paper (wheels, body, roll,
pitch) are about terrain. A leg of the corridor ends at the line that halves its bend; a sample that crosses
it goes on along the next leg.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy import maximum, sqrt

from controllers.costs import Cost
from quadsim.course.corridor import Corridor

TERMS = ("to_go", "lethal", "rollover", "speed")
TO_GO = 6  # column of the target rows
RUN_OUT = 100.0  # [m] a last leg behind the goal, so that plans do not end there


@dataclass(frozen=True)
class CorridorWeights:
    """Weights a_0..a_3, and the numbers they refer to."""

    to_go: float = 0.2  # per metre still to drive
    lethal: float = 500.0  # per metre travelled at a wall; falls linearly to none at the margin
    rollover: float = 10.0  # per metre travelled and (m/s^2)^2 of lateral acceleration above lateral_max
    speed: float = 2.0  # per metre travelled and (m/s)^2 above speed_max
    lateral_max: float = 4.0  # [m/s^2]
    speed_max: float = 7.0  # [m/s]
    margin: float = 0.5  # of the vehicle's side to a wall [m]


def terms(x, x_next, u, target, crashed, p):
    """The weighted terms at x_next, with reached; nothing is latched, as a wall costs by the metre."""
    bx, by, ex, ey, mx, my, to_go = target
    a_0, a_1, a_2, a_3, room, margin, lateral_max, speed_max, dt = p
    px, py, v, r = x_next[0], x_next[1], x_next[4], x_next[5]
    dx, dy = px - bx, py - by
    travelled = v * dt
    beyond = maximum(abs(ex * dy - ey * dx) - room, 0.0) / margin
    lateral = maximum(abs(v * r) - lateral_max, 0.0)
    fast = maximum(v - speed_max, 0.0)
    return (
        a_0 * (sqrt(dx * dx + dy * dy + 1e-6) + to_go),
        a_1 * travelled * beyond,
        a_2 * travelled * lateral * lateral,
        a_3 * travelled * fast * fast,
        dx * mx + dy * my >= 0.0,
        crashed,
    )


def corridor_cost(corridor: Corridor, half_width: float, weights: CorridorWeights, dt: float) -> Cost:
    """For a vehicle of this half width [m] and steps of dt [s]."""
    w, room = weights, corridor.width / 2 - half_width - weights.margin
    params = (w.to_go, w.lethal, w.rollover, w.speed, room, w.margin, w.lateral_max, w.speed_max, dt)
    return Cost("corridor", TERMS, terms, params, targets(corridor), TO_GO)


def targets(corridor: Corridor) -> np.ndarray:
    """A target row for each leg: its end, direction, the normal of its end line, the length of all that follows [m];
    and one for a last leg behind the goal.  (legs + 1, 7)"""
    e, m = corridor.directions, corridor.ends
    ends = np.array(corridor.points[1:])
    run_out = np.concatenate([ends[-1] + RUN_OUT * e[-1], e[-1], e[-1]])
    after = np.append(corridor.lengths[1:], RUN_OUT)
    to_go = np.append(np.cumsum(after[::-1])[::-1], 0.0)
    return np.column_stack([np.vstack([np.column_stack([ends, e, m]), run_out]), to_go])
