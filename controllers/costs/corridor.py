"""The off-road cost on flat ground: the terms of Vlahov et al. 2024, section IV-A, that make sense
there.

    q = a_0 CostToGo + d (a_1 Lethal + a_2 Rollover + a_3 Speed),    d = v dt

The risks count by the metre travelled, so standing still is safe. The other terms of the paper
(wheels, body, roll, pitch) are about terrain. A leg of the corridor ends at the line that halves
its bend; a sample that crosses it goes on along the next leg.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy import maximum, sqrt

from controllers.costs import Cost, Term
from quadsim.course.corridor import Corridor
from quadsim.files.strict_yaml import setting

RUN_OUT = 100.0  # [m] a last leg behind the goal, so that plans do not end there


@dataclass(frozen=True)
class CorridorWeights:
    """Weights a_0..a_3, and the numbers they refer to."""

    to_go: Annotated[float, setting("per metre still to drive")] = 0.2
    lethal: Annotated[
        float, setting("per metre travelled at a wall; falls linearly to none at the margin")
    ] = 500.0
    rollover: Annotated[
        float,
        setting("per metre travelled and (m/s^2)^2 of lateral acceleration above lateral_max"),
    ] = 10.0
    speed: Annotated[float, setting("per metre travelled and (m/s)^2 above speed_max")] = 2.0
    lateral_max: Annotated[float, setting("[m/s^2]")] = 4.0
    speed_max: Annotated[float, setting("[m/s]")] = 7.0
    margin: Annotated[float, setting("of the vehicle's side to a wall [m]")] = 0.5


class LegTarget(NamedTuple):
    """The target row: the end of a leg and its end line, and the way that is left behind it."""

    x: float  # end [m]
    y: float
    ex: float  # direction of the leg
    ey: float
    mx: float  # normal of the line that ends it
    my: float
    to_go: float  # length of all that follows [m]


class CorridorParams(NamedTuple):
    """The numbers that the terms refer to."""

    room: float  # from the centre line to where the walls' margin begins [m]
    margin: float  # [m]
    lateral_max: float  # [m/s^2]
    speed_max: float  # [m/s]
    dt: float  # [s]


def off_end(x_next, leg):
    """Return the way from the leg's end to the vehicle [m].  (2,)"""
    return x_next.px - leg.x, x_next.py - leg.y


def travelled(x_next, p):
    """Return the way of one step [m]."""
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
    """Return the way travelled in the margin of a wall, times how deep in it, 1 at the wall [m]."""
    dx, dy = off_end(x_next, leg)
    beyond = maximum(abs(leg.ex * dy - leg.ey * dx) - p.room, 0.0) / p.margin
    return travelled(x_next, p) * beyond


def rollover(x, x_next, u, leg, p):
    """Return the way travelled times the square of the lateral acceleration above its limit."""
    lateral = maximum(abs(x_next.v * x_next.r) - p.lateral_max, 0.0)
    return travelled(x_next, p) * lateral * lateral


def speed(x, x_next, u, leg, p):
    """Return the way travelled times the square of the speed above its limit."""
    fast = maximum(x_next.v - p.speed_max, 0.0)
    return travelled(x_next, p) * fast * fast


CORRIDOR_TERMS = (to_go, lethal, rollover, speed)
TERMS = tuple(term.__name__ for term in CORRIDOR_TERMS)


def corridor_cost(
    corridor: Corridor, half_width: float, weights: CorridorWeights, dt: float
) -> Cost:
    """Return the cost for a vehicle of this half width [m] and steps of dt [s].

    Nothing is latched, as a wall costs by the metre.
    """
    w = weights
    room = corridor.width / 2 - half_width - w.margin
    return Cost(
        name="corridor",
        terms=tuple(Term(function, getattr(w, function.__name__)) for function in CORRIDOR_TERMS),
        row=LegTarget,
        targets=targets(corridor),
        params=CorridorParams(room, w.margin, w.lateral_max, w.speed_max, dt),
        reached=reached,
    )


def targets(corridor: Corridor) -> np.ndarray:
    """Return a LegTarget for each leg, and one for a last leg behind the goal.  (legs + 1, 7)"""
    directions, normals = corridor.directions, corridor.ends
    ends = np.array(corridor.points[1:])
    run_out = np.concatenate([ends[-1] + RUN_OUT * directions[-1], directions[-1], directions[-1]])
    after = np.append(corridor.lengths[1:], RUN_OUT)
    to_go = np.append(np.cumsum(after[::-1])[::-1], 0.0)
    legs = np.column_stack([ends, directions, normals])
    return np.column_stack([np.vstack([legs, run_out]), to_go])
