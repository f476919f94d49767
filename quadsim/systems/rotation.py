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
