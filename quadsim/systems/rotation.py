"""Rotations by unit quaternions q = (w, u), wxyz, world from body: plain functions, inlined into the lanes too."""

from __future__ import annotations


def to_body(q, v):
    """R(q)^T v = v - w t + u x t with t = 2 u x v, for q = (w, u) world from body."""
    w, ux, uy, uz = q
    x, y, z = v
    tx, ty, tz = 2.0 * (uy * z - uz * y), 2.0 * (uz * x - ux * z), 2.0 * (ux * y - uy * x)
    return x - w * tx + uy * tz - uz * ty, y - w * ty + uz * tx - ux * tz, z - w * tz + ux * ty - uy * tx


def to_world(q, v):
    """R(q) v, the inverse of `to_body`."""
    return to_body((q[0], -q[1], -q[2], -q[3]), v)


def body_axes(q):
    """The columns of R(q), the body's axes in the world, one after another: for many vectors, see `along`.  (9,)"""
    w, x, y, z = q
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * x, y * y, z * z, x * y, x * z, y * z, w * x, w * y, w * z
    return (
        1.0 - 2.0 * (yy + zz), 2.0 * (xy + wz), 2.0 * (xz - wy),
        2.0 * (xy - wz), 1.0 - 2.0 * (xx + zz), 2.0 * (yz + wx),
        2.0 * (xz + wy), 2.0 * (yz - wx), 1.0 - 2.0 * (xx + yy),
    )  # fmt: skip


def along(axes, x, y, z):
    """R(q)^T (x, y, z) by body_axes(q): what `to_body` says, in fewer steps once they are known.  (3,)"""
    a, b, c, d, e, f, g, h, i = axes
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z
