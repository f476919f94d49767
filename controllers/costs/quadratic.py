"""The quadratic cost of the double integrator, q = a_0 |p - g|^2 + a_1 |v|^2: section IV-C of Vlahov et al. 2024."""

from __future__ import annotations

import numpy as np

from controllers.costs import Cost

TERMS = ("distance", "speed")


def terms(x, x_next, u, target, crashed, p):
    """The weighted terms at x_next. The target is the goal; nothing is ever reached, nothing crashes."""
    gx, gy = target
    a_0, a_1 = p
    px, py, vx, vy = x_next
    dx, dy = px - gx, py - gy
    return a_0 * (dx * dx + dy * dy), a_1 * (vx * vx + vy * vy), False, crashed


def quadratic_cost(goal: tuple[float, float], distance: float = 5.0, speed: float = 0.5) -> Cost:
    """distance: weight per m^2, speed: per (m/s)^2."""
    return Cost("quadratic", TERMS, terms, (distance, speed), np.array([goal]))
