"""Eq. (8) without gates: fly to a point at a height and a speed. Only the comparison with peers needs it."""

from __future__ import annotations

import numpy as np
from numpy import sqrt

from controllers.costs import Cost

POINT = (50.0, 0.0, 2.0)  # [m]


def terms(x, x_next, u, target, crashed, p):
    """Distance to a point, heading, height, speed and tilt of x_next; nothing is reached, nothing crashes."""
    gx, gy, gz, a_0, a_1, a_2, a_3, a_4, v_des = p
    px, py, pz, vx, vy, qx, qy = x_next[0], x_next[1], x_next[2], x_next[3], x_next[4], x_next[7], x_next[8]
    dx, dy, dz = px - gx, py - gy, pz - gz
    d = sqrt(dx * dx + dy * dy + dz * dz + 1e-6)
    d_xy = sqrt(dx * dx + dy * dy + 1e-6)
    v_xy = sqrt(vx * vx + vy * vy + 1e-6)
    off = v_xy - v_des
    return (
        a_0 * d,
        a_1 * (1.0 + (vx * dx + vy * dy) / (v_xy * d_xy)),
        a_2 * dz * dz,
        a_3 * off * off,
        a_4 * 2.0 * (qx * qx + qy * qy),
        px > 1e6,
        crashed,
    )


def point_cost() -> Cost:
    params = (*POINT, 8.0, 40.0, 4.0, 0.5, 10.0, 9.0)
    return Cost("point", ("progress", "heading", "height", "speed", "stabilize"), terms, params, np.zeros((1, 1)))
