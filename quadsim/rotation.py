"""Vectors and rotations: unit quaternions, matrices, Euler angles and small turns.

An attitude is a unit quaternion q = (w, x, y, z) that turns vectors of the body into vectors of the
world. Angles are in radians. Euler angles are yaw about z, then pitch about the new y, then roll
about the new x, so that R = Rz(yaw) Ry(pitch) Rx(roll).

The first part is plain arithmetic on scalars. The compiled lanes inline these functions, which also
accept arrays and CasADi symbols. The second part works on the floats of one state: at 400 Hz the
overhead of arrays of three numbers would be most of the cost.

Flights are compared to the last bit. Some quantities are computed by two formulas that round
differently, here or elsewhere in the project; therefore each caller must keep its formula.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import asin, atan2, cos, hypot, sin, sqrt

import numpy as np

Vec3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # wxyz, of unit length

# [rad] A turn below this is taken as linear.
SMALL = 1e-9
# An axis is vertical if its height is nearer to 1 than this.
VERTICAL = 1e-12


# Plain arithmetic, inlined into the compiled lanes.


def to_body(q, v):
    """Return R(q)^T v, a vector of the world in the body's axes.

    With q = (w, u) this is v - w t + u x t, where t = 2 u x v.

    Args:
        q: attitude, wxyz  (4,).
        v: vector in world axes  (3,).

    Returns:
        The vector in body axes  (3,).
    """
    w, ux, uy, uz = q
    x, y, z = v
    tx = 2.0 * (uy * z - uz * y)
    ty = 2.0 * (uz * x - ux * z)
    tz = 2.0 * (ux * y - uy * x)
    return (
        x - w * tx + uy * tz - uz * ty,
        y - w * ty + uz * tx - ux * tz,
        z - w * tz + ux * ty - uy * tx,
    )


def to_world(q, v):
    """Return R(q) v, a vector of the body in the world's axes: the inverse of `to_body`.  (3,)"""
    return to_body((q[0], -q[1], -q[2], -q[3]), v)


def body_axes(q):
    """Return the columns of R(q), the body's axes in the world, one after another.

    Args:
        q: attitude, wxyz  (4,).

    Returns:
        The three columns, an argument of `along`  (9,).
    """
    w, x, y, z = q
    xx = x * x
    yy = y * y
    zz = z * z
    xy = x * y
    xz = x * z
    yz = y * z
    wx = w * x
    wy = w * y
    wz = w * z
    return (
        1.0 - 2.0 * (yy + zz), 2.0 * (xy + wz), 2.0 * (xz - wy),
        2.0 * (xy - wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz + wx),
        2.0 * (xz + wy), 2.0 * (yz - wx), 1.0 - 2.0 * (xx + yy),
    )  # fmt: skip


def along(axes, x, y, z):
    """Return R(q)^T (x, y, z) from body_axes(q).

    It equals `to_body`, with fewer operations if the axes are known.

    Args:
        axes: result of `body_axes`  (9,).
        x, y, z: vector in world axes.

    Returns:
        The vector in body axes  (3,).
    """
    a, b, c, d, e, f, g, h, i = axes
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def in_frame(d, passage, left, up):
    """Return the components of a vector along the three axes of a frame, such as a gate's.

    Args:
        d: vector in world axes, scalars or arrays  (3,).
        passage, left, up: axes of the frame in the world, each (3,).

    Returns:
        The components  (3,).
    """
    return (
        passage[0] * d[0] + passage[1] * d[1] + passage[2] * d[2],
        left[0] * d[0] + left[1] * d[1] + left[2] * d[2],
        up[0] * d[0] + up[1] * d[1] + up[2] * d[2],
    )


def quaternion_rate(q, m):
    """Return q x (0, m): with m = omega / 2, the rate at which the attitude q changes.

    Args:
        q: attitude, wxyz  (4,).
        m: half the body rates, in body axes  (3,).

    Returns:
        The rate of the quaternion  (4,).
    """
    qw, qx, qy, qz = q
    mx, my, mz = m
    return (
        -(qx * mx + qy * my + qz * mz),
        qw * mx + qy * mz - qz * my,
        qw * my - qx * mz + qz * mx,
        qw * mz + qx * my - qy * mx,
    )


# Attitudes of one state, in plain floats.


def product(a: Sequence[float], b: Sequence[float]) -> Quaternion:
    """Return the product a x b, the attitude a followed by the rotation b in a's axes."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def exp(turn: Sequence[float]) -> Quaternion:
    """Return the quaternion of a rotation vector.

    Args:
        turn: rotation vector, axis times angle [rad]  (3,).
    """
    x, y, z = turn
    angle = hypot(x, y, z)
    s = sin(0.5 * angle) / angle if angle > SMALL else 0.5
    return cos(0.5 * angle), s * x, s * y, s * z


def log(q: Sequence[float]) -> Vec3:
    """Return the shortest rotation vector [rad] of a quaternion, the inverse of `exp`."""
    # q and -q are one attitude: the turn is the short one for the sign with w >= 0.
    w, x, y, z = q if q[0] >= 0.0 else tuple(-c for c in q)
    s = hypot(x, y, z)
    k = 2.0 * atan2(s, w) / s if s > SMALL else 2.0 / max(w, SMALL)
    return k * x, k * y, k * z


def between(a: Sequence[float], b: Sequence[float]) -> Vec3:
    """Return the rotation vector in the body frame from attitude a to attitude b [rad]."""
    return log(product((a[0], -a[1], -a[2], -a[3]), b))


def turned(q: Sequence[float], turn: Sequence[float]) -> Quaternion:
    """Return the attitude q followed by a rotation in the body frame, as a unit quaternion.

    Args:
        q: attitude, wxyz  (4,).
        turn: rotation vector, axis times angle [rad]  (3,).
    """
    w, x, y, z = product(q, exp(turn))
    n = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return n * w, n * x, n * y, n * z


def turned_at(q: Sequence[float], body_rates: Sequence[float], dt: float) -> Quaternion:
    """Return the attitude q after dt [s] at constant body rates [rad/s], as a unit quaternion.

    It equals `turned(q, body_rates * dt)` up to rounding errors.
    """
    wx, wy, wz = body_rates
    rate = hypot(wx, wy, wz)
    c = cos(0.5 * rate * dt)
    s = sin(0.5 * rate * dt) / rate if rate > 0.0 else 0.5 * dt
    dw, dx, dy, dz = quaternion_rate(q, (s * wx, s * wy, s * wz))

    w = c * q[0] + dw
    x = c * q[1] + dx
    y = c * q[2] + dy
    z = c * q[3] + dz
    length = hypot(w, x, y, z)
    return w / length, x / length, y / length, z / length


def from_yaw(yaw: float) -> Quaternion:
    """Return the level attitude with a yaw [rad]."""
    return cos(0.5 * yaw), 0.0, 0.0, sin(0.5 * yaw)


def from_euler(yaw: float, pitch: float, roll: float) -> Quaternion:
    """Return the attitude with given Euler angles [rad]."""
    about_y = (cos(0.5 * pitch), 0.0, sin(0.5 * pitch), 0.0)
    about_x = (cos(0.5 * roll), sin(0.5 * roll), 0.0, 0.0)
    return product(product(from_yaw(yaw), about_y), about_x)


def euler_angles(q: Sequence[float]) -> Vec3:
    """Return yaw, pitch and roll of an attitude [rad], the inverse of `from_euler`.

    If the body's x axis is vertical, yaw and roll rotate about the same axis, and 0 is returned for
    the roll.
    """
    xx, xy, xz, yx, yy, _, _, _, zz = body_axes(q)
    yz = 2.0 * (q[2] * q[3] + q[0] * q[1])
    pitch = -asin(min(max(xz, -1.0), 1.0))
    if abs(xz) > 1.0 - VERTICAL:
        return atan2(-yx, yy), pitch, 0.0
    return atan2(xy, xx), pitch, atan2(yz, zz)


# Matrices.


def without_jumps(q: np.ndarray) -> np.ndarray:
    """Return quaternions with signs that make the sequence continuous.

    q and -q are the same attitude; a simulator may switch between them from step to step.

    Args:
        q: quaternions wxyz  (n, 4).
    """
    signs = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    return q * np.concatenate([[1.0], np.cumprod(signs)])[: len(q), None]


def matrix(q: Sequence[float]) -> np.ndarray:
    """Return R(q), whose columns are the body's axes in the world.  (3, 3)"""
    # the world's components of the body's x, y and z axis, in turn
    xx, xy, xz, yx, yy, yz, zx, zy, zz = body_axes(q)
    return np.array([[xx, yx, zx], [xy, yy, zy], [xz, yz, zz]])


def euler_matrix(yaw: float, pitch: float, roll: float) -> np.ndarray:
    """Return R = Rz(yaw) Ry(pitch) Rx(roll) for Euler angles [rad].  (3, 3)"""
    cy = np.cos(yaw)
    cp = np.cos(pitch)
    cr = np.cos(roll)
    sy = np.sin(yaw)
    sp = np.sin(pitch)
    sr = np.sin(roll)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def skew(v: Sequence[float]) -> np.ndarray:
    """Return [v]_x, so that skew(v) @ u is the cross product v x u.  (3, 3)"""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
