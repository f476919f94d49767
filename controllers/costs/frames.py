"""The frames of all gates, and a course's obstacles, in a rollout: rows of numbers, and the test of a straight line.

The vehicle is a sphere whose centre moves on the line. The four bars of a frame, as boxes grown by the sphere's radius
and a margin, fill a slab around the gate's plane from a free shaft to the outer edge, as for the referee
(quadsim.course.swept). A box is a slab without a shaft; so is a cylinder, lying across its axis, with a round outline.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy import maximum, minimum, where

from controllers.costs import Obstacles
from quadsim.course import FRAME_DEPTH, Course, Cylinder, Gate, Obstacle, in_frame

SAFETY_MARGIN = 0.02  # [m] kept between vehicle and frame; where a gate is narrow, at most half of the room there is
ACCELERATION = 40.0  # [m/s^2] with which frames may be reached
UPRIGHT = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)  # axes of a cylinder as of a frame: its own comes first
NO_SHAFT = -1.0  # half width of the opening of what has none [m]
NOT_ROUND = 1e12  # square of the radius of an outline with corners [m^2]


class FrameRow(NamedTuple):
    """A gate's frame, grown by the vehicle's radius and margins: a slab around the gate's plane with a free shaft."""

    x_low: float  # of a box around it [m]
    y_low: float
    z_low: float
    x_high: float
    y_high: float
    z_high: float
    x: float  # centre [m]
    y: float
    z: float
    nx: float  # passage
    ny: float
    nz: float
    lx: float  # left axis
    ly: float
    lz: float
    ux: float  # up axis
    uy: float
    uz: float
    half: float  # half the depth of the slab [m]
    free_y: float  # half sizes of the shaft [m]
    free_z: float
    out_y: float  # half sizes of the slab [m]
    out_z: float


class ObstacleRow(NamedTuple):
    """The same of a frame or an obstacle whose outline may be round."""

    x_low: float
    y_low: float
    z_low: float
    x_high: float
    y_high: float
    z_high: float
    x: float
    y: float
    z: float
    nx: float
    ny: float
    nz: float
    lx: float
    ly: float
    lz: float
    ux: float
    uy: float
    uz: float
    half: float
    free_y: float
    free_z: float
    out_y: float
    out_z: float
    radius2: float  # square of the radius of its outline [m^2]


def in_slab(p, row):
    """Return the position p in the slab's frame: along its axis, left, up."""
    x, y, z = p
    d = (x - row.x, y - row.y, z - row.z)
    return in_frame(d, (row.nx, row.ny, row.nz), (row.lx, row.ly, row.lz), (row.ux, row.uy, row.uz))


def touches(p0, p1, row):
    """Return whether the line from p0 to p1 touches the frame.

    It does if within the slab it is not all in the shaft, nor all on one side of the outer edge.
    """
    s0, y0, z0 = in_slab(p0, row)
    s1, y1, z1 = in_slab(p1, row)

    # the part of the line within the slab, as fractions of the line
    span = where(abs(s1 - s0) < 1e-6, 1e-6, s1 - s0)
    a = (-row.half - s0) / span
    b = (row.half - s0) / span
    enters = maximum(minimum(a, b), 0.0)
    leaves = minimum(maximum(a, b), 1.0)

    # where it is at either end of that part
    ya = y0 + enters * (y1 - y0)
    yb = y0 + leaves * (y1 - y0)
    za = z0 + enters * (z1 - z0)
    zb = z0 + leaves * (z1 - z0)
    off_shaft = maximum(maximum(abs(ya), abs(yb)) - row.free_y, maximum(abs(za), abs(zb)) - row.free_z) > 0.0
    across = (minimum(ya, yb) < row.out_y) & (maximum(ya, yb) > -row.out_y)
    upright = (minimum(za, zb) < row.out_z) & (maximum(za, zb) > -row.out_z)
    return (enters < leaves) & off_shaft & across & upright


def touches_round(p0, p1, row):
    """Return whether the line touches what the row describes, with corners or round.

    Beyond `touches`, the line also has to meet the slab's outline, not only the ranges of its two sides. Only a course
    with obstacles pays for it.
    """
    s0, y0, z0 = in_slab(p0, row)
    s1, y1, z1 = in_slab(p1, row)

    # the part of the line within the box around the slab (Liang and Barsky 1984)
    ds = away_from_zero(s1 - s0)
    dy = away_from_zero(y1 - y0)
    dz = away_from_zero(z1 - z0)
    sa = (-row.half - s0) / ds
    sb = (row.half - s0) / ds
    ya = (-row.out_y - y0) / dy
    yb = (row.out_y - y0) / dy
    za = (-row.out_z - z0) / dz
    zb = (row.out_z - z0) / dz
    enters = maximum(maximum(minimum(sa, sb), minimum(ya, yb)), maximum(minimum(za, zb), 0.0))
    leaves = minimum(minimum(maximum(sa, sb), maximum(ya, yb)), minimum(maximum(za, zb), 1.0))

    # the point of that part that is nearest to the axis
    nearest = -(y0 * dy + z0 * dz) / (dy * dy + dz * dz)
    nearest = minimum(maximum(nearest, enters), leaves)
    y = y0 + nearest * dy
    z = z0 + nearest * dz
    return touches(p0, p1, row) & (enters < leaves) & (y * y + z * z < row.radius2)


def away_from_zero(d):
    """A difference that can be divided by [m]."""
    return where(abs(d) < 1e-6, 1e-6, d)


def inner_margin(openings: np.ndarray, radius: float) -> np.ndarray:
    """The safety margin inside openings (gates, 2) for a vehicle of this radius [m].  (gates,)"""
    return np.minimum(SAFETY_MARGIN, (openings.min(axis=1) / 2 - radius) / 2)


def course_obstacles(course: Course, radius: float) -> Obstacles:
    """Every frame once, and what else stands there. Lines run beside the curve that is flown, by .008 m at 40 m/s^2
    over .04 s: half of the safety margin is left to that, so that a gate flown through as `terms` allows is no crash
    here.
    """
    gates, others = tuple(dict.fromkeys(course.gates)), course.obstacles
    inner = inner_margin(np.array([g.opening for g in gates]), radius)[:, None]
    margin = SAFETY_MARGIN / 2
    rows, bare = frame_rows(gates, radius, inner / 2, margin), frame_rows(gates, radius, 0 * inner, 0.0)
    if not others:
        return Obstacles(touches, FrameRow, rows, partial(in_reach, touches, FrameRow, rows, bare))
    rows, bare = (
        np.vstack([np.hstack([of_frames, np.full((len(gates), 1), NOT_ROUND)]), obstacle_rows(others, radius + outer)])
        for of_frames, outer in ((rows, margin), (bare, 0.0))
    )
    return Obstacles(touches_round, ObstacleRow, rows, partial(in_reach, touches_round, ObstacleRow, rows, bare))


def obstacle_rows(obstacles: Sequence[Obstacle], grown: float) -> np.ndarray:
    """For `touches_round`, grown by this much on all sides [m].  (obstacles, 24)"""
    rows = []
    for o in obstacles:
        low, high = o.corners().min(axis=0) - grown, o.corners().max(axis=0) + grown
        if isinstance(o, Cylinder):
            axes, sizes, radius2 = UPRIGHT, (o.height / 2, o.radius, o.radius), (o.radius + grown) ** 2
        else:
            axes, sizes, radius2 = o.axes, o.half, NOT_ROUND
        half, *out = (size + grown for size in sizes)
        rows.append([*low, *high, *o.centre, *np.ravel(axes), half, NO_SHAFT, NO_SHAFT, *out, radius2])
    return np.array(rows)


def frame_rows(gates: Sequence[Gate], radius: float, inner: np.ndarray, outer: float) -> np.ndarray:
    """For `touches`, with margins inside the openings (gates, 1) and around the frames [m].  (gates, 23)"""
    opening, width = np.array([g.opening for g in gates]), np.array([[g.frame_width] for g in gates])
    half = np.full_like(width, FRAME_DEPTH / 2 + radius + outer)
    out = opening / 2 + width + radius + outer
    turns = np.array([g.rotation for g in gates])  # (gates, 3, 3)
    centres = np.array([g.position for g in gates])
    reach = (abs(turns) @ np.hstack([half, out])[:, :, None])[:, :, 0]  # of the box around the grown frame
    axes = turns.transpose(0, 2, 1).reshape(-1, 9)  # passage, left, up
    return np.hstack([centres - reach, centres + reach, centres, axes, half, opening / 2 - radius - inner, out])


def in_reach(
    test: Callable, row: type, rows: np.ndarray, bare: np.ndarray, x: np.ndarray, seconds: float
) -> np.ndarray:
    """The rows that may be reached from the state x; without the margin, where x is within it."""
    p, way, turn = x[:3], x[3:6] * seconds, 0.5 * ACCELERATION * seconds**2
    low, high = rows[:, :3] - np.maximum(way, 0.0) - turn, rows[:, 3:6] - np.minimum(way, 0.0) + turn
    near = np.flatnonzero(((low <= p) & (p <= high)).all(axis=1))
    inside = near[((rows[near, :3] <= p) & (p <= rows[near, 3:6])).all(axis=1)]
    found = rows[near]
    for k in inside:
        if test(p, p, row(*rows[k])):
            found[near == k] = bare[k]
    return found
