"""The off-road cost on flat ground, from Vlahov et al. 2024, section IV-A.

    q = a_0 CostToGo + d (a_1 Lethal + a_2 Rollover + a_3 Speed),    d = v dt

The risks are charged per metre travelled, so standing still is safe. The paper's other terms
(wheels, body, roll, pitch) need terrain and are left out. A leg of the corridor ends at the line
that halves its bend; a sample that crosses this line continues along the next leg.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy import maximum, sqrt

from quadsim.controllers.costs import Cost, Term
from quadsim.paper.corridor import Corridor

RUN_OUT = 100.0  # [m] a last leg behind the goal, so that plans do not end there


@dataclass(frozen=True)
class CorridorWeights:
    """The weights a_0..a_3, and the parameters of the terms; the values are not the paper's."""

    to_go: float = 0.2  # per metre still to drive
    lethal: float = 500.0  # per metre travelled at a wall; falls linearly to none at the margin
    # per metre travelled and (m/s^2)^2 of lateral acceleration above lateral_max
    rollover: float = 10.0
    speed: float = 2.0  # per metre travelled and (m/s)^2 above speed_max
    lateral_max: float = 4.0  # [m/s^2]
    speed_max: float = 7.0  # [m/s]
    margin: float = 0.5  # between the vehicle's side and a wall [m]


class LegTarget(NamedTuple):
    """The target row: the end of a leg, its end line, and the remaining distance behind it."""

    x: float  # end [m]
    y: float
    ex: float  # direction of the leg
    ey: float
    mx: float  # normal of the line that ends it
    my: float
    to_go: float  # length of all later legs [m]


class CorridorParams(NamedTuple):
    """The parameters of the terms."""

    room: float  # from the centre line to the beginning of the walls' margin [m]
    margin: float  # [m]
    lateral_max: float  # [m/s^2]
    speed_max: float  # [m/s]
    dt: float  # [s]


def off_end(x_next, leg):
    """Return the vector from the leg's end to the vehicle [m].  (2,)"""
    return x_next.px - leg.x, x_next.py - leg.y


def travelled(x_next, p):
    """Return the distance travelled in one step [m]."""
    return x_next.v * p.dt


def reached(x, x_next, u, leg, p):
    """Return whether the vehicle is beyond the line that ends the leg."""
    dx, dy = off_end(x_next, leg)
    return dx * leg.mx + dy * leg.my >= 0.0


def to_go(x, x_next, u, leg, p):
    """Return the distance still to drive [m]."""
    dx, dy = off_end(x_next, leg)
    return sqrt(dx * dx + dy * dy + 1e-6) + leg.to_go


def lethal(x, x_next, u, leg, p):
    """Return the distance travelled [m] times how far the car is within a wall's margin.

    The second factor is 0 where the margin begins, and 1 at the wall.
    """
    dx, dy = off_end(x_next, leg)
    beyond = maximum(abs(leg.ex * dy - leg.ey * dx) - p.room, 0.0) / p.margin
    return travelled(x_next, p) * beyond


def rollover(x, x_next, u, leg, p):
    """Return the distance travelled times the squared excess of the lateral acceleration."""
    lateral = maximum(abs(x_next.v * x_next.r) - p.lateral_max, 0.0)
    return travelled(x_next, p) * lateral * lateral


def speed(x, x_next, u, leg, p):
    """Return the distance travelled times the squared excess of the speed over its limit."""
    fast = maximum(x_next.v - p.speed_max, 0.0)
    return travelled(x_next, p) * fast * fast


def corridor_cost(
    corridor: Corridor,
    half_width: float,
    dt: float,
    weights: CorridorWeights = CorridorWeights(),
) -> Cost:
    """Return the cost of driving along a corridor, in which a wall is charged per metre.

    Args:
        corridor: corridor to drive along.
        half_width: half the width of the vehicle [m].
        dt: control period [s].
        weights: weights and parameters of the terms.
    """
    terms = (
        Term(to_go, weights.to_go),
        Term(lethal, weights.lethal),
        Term(rollover, weights.rollover),
        Term(speed, weights.speed),
    )
    params = CorridorParams(
        room=corridor.width / 2 - half_width - weights.margin,
        margin=weights.margin,
        lateral_max=weights.lateral_max,
        speed_max=weights.speed_max,
        dt=dt,
    )
    return Cost(
        name="corridor",
        terms=terms,
        row=LegTarget,
        targets=targets(corridor),
        params=params,
        reached=reached,
    )


def targets(corridor: Corridor) -> np.ndarray:
    """Return a LegTarget for each leg, and one more for a leg behind the goal.  (legs + 1, 7)"""
    directions = corridor.directions
    ends = np.array(corridor.points[1:])
    legs = np.column_stack([ends, directions, corridor.ends])
    run_out = np.concatenate([ends[-1] + RUN_OUT * directions[-1], directions[-1], directions[-1]])

    # The distance behind a leg's end is the sum of all later legs.
    after = np.append(corridor.lengths[1:], RUN_OUT)
    left = np.append(np.cumsum(after[::-1])[::-1], 0.0)
    return np.column_stack([np.vstack([legs, run_out]), left])
