"""The quadratic cost of the double integrator, q = a_0 |p - g|^2 + a_1 |v|^2: section IV-C of
Vlahov et al. 2024."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from controllers.costs import Cost, Term
from quadsim.files.strict_yaml import setting

TERMS = ("distance", "speed")


class Goal(NamedTuple):
    """The target row: a point in the plane, which is never reached."""

    x: float  # [m]
    y: float


@dataclass(frozen=True)
class QuadraticWeights:
    """Weights a_0 and a_1."""

    distance: Annotated[float, setting("per m^2 from the goal")] = 5.0
    speed: Annotated[float, setting("per (m/s)^2")] = 0.5


def distance(x, x_next, u, goal, p):
    """Return the square of the distance to the goal [m^2]."""
    dx = x_next.px - goal.x
    dy = x_next.py - goal.y
    return dx * dx + dy * dy


def speed(x, x_next, u, goal, p):
    """Return the square of the speed [(m/s)^2]."""
    return x_next.vx * x_next.vx + x_next.vy * x_next.vy


def quadratic_cost(goal: tuple[float, float], weights: QuadraticWeights | None = None) -> Cost:
    """Return the cost of reaching a goal [m] in the plane and stopping there."""
    w = weights or QuadraticWeights()
    terms = (Term(distance, w.distance), Term(speed, w.speed))
    return Cost("quadratic", terms, Goal, np.array([goal]))
