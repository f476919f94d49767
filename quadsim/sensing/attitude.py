"""Attitudes as unit quaternions q = (w, x, y, z), world from body, and the small turns between them.

Plain floats where one state is moved, arrays where a covariance is: at 250 Hz the overhead of arrays of three numbers
would be most of the cost of the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, cos, hypot, sin, sqrt

import numpy as np

Vector = tuple[float, ...]
SMALL = 1e-9  # [rad] below this a turn is taken as linear


def product(a: Sequence[float], b: Sequence[float]) -> Vector:
    """a x b.  (4,)"""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def exp(turn: Sequence[float]) -> Vector:
    """The attitude after the turn (3,) [rad] from the identity.  (4,)"""
    x, y, z = turn
    angle = hypot(x, y, z)
    s = sin(0.5 * angle) / angle if angle > SMALL else 0.5
    return cos(0.5 * angle), s * x, s * y, s * z


def log(q: Sequence[float]) -> Vector:
    """The shortest turn [rad] that leads from the identity to q, the inverse of `exp`.  (3,)"""
    w, x, y, z = q if q[0] >= 0.0 else tuple(-c for c in q)
    s = hypot(x, y, z)
    k = 2.0 * atan2(s, w) / s if s > SMALL else 2.0 / max(w, SMALL)
    return k * x, k * y, k * z


def between(a: Sequence[float], b: Sequence[float]) -> Vector:
    """The turn in the body frame that leads from the attitude a to b [rad].  (3,)"""
    return log(product((a[0], -a[1], -a[2], -a[3]), b))


def turned(q: Sequence[float], turn: Sequence[float]) -> Vector:
    """q followed by a turn in the body frame [rad], of unit length.  (4,)"""
    w, x, y, z = product(q, exp(turn))
    n = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return n * w, n * x, n * y, n * z


def rotate(q: Sequence[float], v: Sequence[float]) -> Vector:
    """R(q) v: a vector of the body in the world.  (3,)"""
    w, ux, uy, uz = q
    x, y, z = v
    tx, ty, tz = 2.0 * (uy * z - uz * y), 2.0 * (uz * x - ux * z), 2.0 * (ux * y - uy * x)
    return x + w * tx + uy * tz - uz * ty, y + w * ty + uz * tx - ux * tz, z + w * tz + ux * ty - uy * tx


def rotate_back(q: Sequence[float], v: Sequence[float]) -> Vector:
    """R(q)^T v: a vector of the world in the body.  (3,)"""
    return rotate((q[0], -q[1], -q[2], -q[3]), v)


def matrix(q: Sequence[float]) -> np.ndarray:
    """R(q).  (3, 3)"""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def skew(v: Sequence[float]) -> np.ndarray:
    """[v]_x, so that skew(v) @ u is the cross product v x u.  (3, 3)"""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
