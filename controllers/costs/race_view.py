"""The racing cost of a vehicle that sees gates by a camera: eq. (8), and the next gate kept in the camera's view.

    q = q_race + a_v (1 - cos angle between the optical axis and the bearing to the next gate)

Perception-aware planning as in PAMPC (Falanga, Foehn, Lu and Scaramuzza, IROS 2018), whose cost keeps a point of
interest in the middle of the picture, and in Swift's reward for the angle between optical axis and next gate (Kaufmann
et al., Nature 2023). A quadrotor's heading is free as far as its path goes: the term costs yaw, and tilt only where
that does not hold the gate in view.
"""

from __future__ import annotations

from dataclasses import replace

from numpy import maximum, sqrt, where

from controllers.costs import Cost
from controllers.costs.race import AT_TARGET
from controllers.costs.race import terms as race_terms
from quadsim.systems.quadrotor import thrust_axis
from quadsim.vehicle import Vec3


def nose(qw, qx, qy, qz):
    """R(q) e_x: the body's x axis in the world.  (3,)"""
    return 1.0 - 2.0 * (qy * qy + qz * qz), 2.0 * (qx * qy + qw * qz), 2.0 * (qx * qz - qw * qy)


def terms(x, x_next, u, target, crashed, p):
    """Those of the racing cost with the view before `reached` and `crashed`; the last three of p are the view's."""
    q = race_terms(x, x_next, u, target, crashed, p[:18])
    a_v, along, above = p[18], p[19], p[20]  # weight, optical axis in the body's x and z
    qw, qx, qy, qz = x_next[6], x_next[7], x_next[8], x_next[9]
    fx, fy, fz = nose(qw, qx, qy, qz)
    zx, zy, zz = thrust_axis(qw, qx, qy, qz)
    dx, dy, dz = target[0] - x_next[0], target[1] - x_next[1], target[2] - x_next[2]
    d = sqrt(maximum(dx * dx + dy * dy + dz * dz, 1e-6))
    ahead = along * (fx * dx + fy * dy + fz * dz) + above * (zx * dx + zy * dy + zz * dz)
    view = a_v * where(d > AT_TARGET, 1.0 - ahead / d, 0.0)
    return q[0], q[1], q[2], q[3], q[4], q[5], q[6], q[7], q[8], view, q[9], q[10]


def with_view(cost: Cost, weight: float, axis: Vec3) -> Cost:
    """The racing cost with the view term. axis: the camera's optical axis in the body frame, in its x-z plane."""
    along, _, above = axis
    return replace(
        cost,
        name="race_view",
        term_names=(*cost.term_names, "view"),
        terms=terms,
        params=(*cost.params, weight, along, above),
    )
