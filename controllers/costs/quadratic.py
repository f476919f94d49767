"""The quadratic cost of the double integrator, q = a_0 |p - g|^2 + a_1 |v|^2: section IV-C of Vlahov et al. 2024."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from controllers.costs import Cost

TERMS = ("distance", "speed")


@dataclass(frozen=True)
class QuadraticWeights:
    """Weights a_0 and a_1."""

    distance: float = 5.0  # per m^2 from the goal
    speed: float = 0.5  # per (m/s)^2


def terms(x, x_next, u, target, crashed, p):
    """The weighted terms at x_next. The target is the goal; nothing is ever reached, nothing crashes."""
    gx, gy = target
    a_0, a_1 = p
    px, py, vx, vy = x_next
    dx, dy = px - gx, py - gy
    return a_0 * (dx * dx + dy * dy), a_1 * (vx * vx + vy * vy), False, crashed


def quadratic_cost(goal: tuple[float, float], weights: QuadraticWeights | None = None) -> Cost:
    """The cost of reaching a goal [m] in the plane and stopping there."""
    w = weights or QuadraticWeights()
    return Cost("quadratic", TERMS, terms, (w.distance, w.speed), np.array([goal]))
