"""Two double integrators side by side, x' = v, v' = k u: the system of Table II and its cost.

The numbers are from Vlahov et al. 2024, section IV-C. The integrator is explicit Euler, in which
the position moves with the old velocity. The controls have no limits, within the range of float32.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.controllers.costs import Cost, Term
from quadsim.dynamics import System

UNLIMITED = 1e30  # finite, as the compiled lanes require


class PointState(NamedTuple):
    """Position and velocity in the plane."""

    px: float  # [m]
    py: float  # [m]
    vx: float  # [m/s]
    vy: float  # [m/s]


class PointControl(NamedTuple):
    """Commanded acceleration."""

    ax_cmd: float  # [m/s^2]
    ay_cmd: float  # [m/s^2]


class PointParams(NamedTuple):
    """The parameter of `step`."""

    gain: float  # k, acceleration per unit of control


class Goal(NamedTuple):
    """The target row: a point in the plane, which is never reached."""

    x: float  # [m]
    y: float


def step(x, u, p, dt):
    """Return the state after dt [s] from the state x under the control u, with parameters p."""
    return PointState(
        px=x.px + x.vx * dt,
        py=x.py + x.vy * dt,
        vx=x.vx + p.gain * u.ax_cmd * dt,
        vy=x.vy + p.gain * u.ay_cmd * dt,
    )


def double_integrator(dt: float, gain: float = 1.0) -> System:
    """Return the system for a control period dt [s] and a gain k [m/s^2 per unit of control]."""
    return System(
        name="double_integrator",
        state=PointState,
        control=PointControl,
        step=step,
        params=PointParams(gain),
        dt=dt,
        low=PointControl(-UNLIMITED, -UNLIMITED),
        high=PointControl(UNLIMITED, UNLIMITED),
        rest=PointControl(0.0, 0.0),
    )


def distance(x, x_next, u, goal, p):
    """Return the square of the distance to the goal [m^2]."""
    dx = x_next.px - goal.x
    dy = x_next.py - goal.y
    return dx * dx + dy * dy


def speed(x, x_next, u, goal, p):
    """Return the square of the speed [(m/s)^2]."""
    return x_next.vx * x_next.vx + x_next.vy * x_next.vy


def quadratic_cost(goal: tuple[float, float]) -> Cost:
    """Return the cost of reaching a goal [m] in the plane and stopping there.

    q = 5 |p - g|^2 + 0.5 |v|^2
    """
    return Cost(
        name="quadratic",
        terms=(Term(distance, 5.0), Term(speed, 0.5)),
        row=Goal,
        targets=np.array([goal]),
    )
