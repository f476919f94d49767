"""Frames of gates and obstacles in rollouts: rows of numbers, and a test of line segments.

The vehicle is a sphere whose centre moves on the line. The four bars of a frame, as boxes grown by
the sphere's radius and a margin, fill a slab around the gate's plane from a free shaft to the outer
edge, as for the referee (quadsim.course.swept). A box is a slab without a shaft. A cylinder is a
slab without a shaft and with a round outline, along the cylinder's axis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy import maximum, minimum, where

from quadsim.controllers.costs import Obstacles
from quadsim.course import Course, Cylinder, Gate, Obstacle, in_frame
from quadsim.course.frames import frames
from quadsim.course.opening import (
    HalfSizes,
    free_half_sizes,
    half_depth,
    margin_inside,
    outer_half_sizes,
)
from quadsim.dynamics.named_tuples import as_rows, columns
from quadsim.rotation import Vec3

# Clearance between vehicle and frame [m]; in a narrow gate at most half of the free space
SAFETY_MARGIN = 0.02
ACCELERATION = 40.0  # [m/s^2] largest acceleration in the test whether a frame can be reached
# Axes of a cylinder's slab in the order of a frame's: the cylinder's axis comes first
UPRIGHT = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
NO_SHAFT = HalfSizes(-1.0, -1.0)  # half sizes of the shaft of a slab without one [m]
NOT_ROUND = 1e12  # square of the radius of an outline with corners [m^2]


class ObstacleRow(NamedTuple):
    """A row describes the slab of a gate's frame or of an obstacle, in the world frame [m].

    `touches` tests line segments against it. quadsim.course.opening explains slab and shaft. All
    sizes include the vehicle's radius and a margin.
    """

    # Corners of the axis-aligned bounding box
    x_low: float
    y_low: float
    z_low: float
    x_high: float
    y_high: float
    z_high: float

    # Centre
    x: float
    y: float
    z: float

    # Unit vectors along the slab's axis, left and up. The axis is the passage of a gate, the x axis
    # of a box, the axis of a cylinder
    nx: float
    ny: float
    nz: float
    lx: float
    ly: float
    lz: float
    ux: float
    uy: float
    uz: float

    # Half the depth of the slab
    half: float
    # Half width and half height of the free shaft, NO_SHAFT if there is none
    free_y: float
    free_z: float
    # Half width and half height of the slab
    out_y: float
    out_z: float
    # Square of the radius of the slab's outline [m^2], NOT_ROUND if the outline has corners
    radius2: float


def in_slab(p, row):
    """Return the position p in the slab's frame: along its axis, left, up."""
    x, y, z = p
    d = (x - row.x, y - row.y, z - row.z)
    return in_frame(d, (row.nx, row.ny, row.nz), (row.lx, row.ly, row.lz), (row.ux, row.uy, row.uz))


def touches(p0, p1, row):
    """Return whether the line from p0 to p1 touches a slab with corners.

    It does not if the part of the line within the slab lies in the shaft, or beyond one outer edge.
    """
    s0, y0, z0 = in_slab(p0, row)
    s1, y1, z1 = in_slab(p1, row)

    # The part of the line within the slab, as fractions of the line
    span = where(abs(s1 - s0) < 1e-6, 1e-6, s1 - s0)
    a = (-row.half - s0) / span
    b = (row.half - s0) / span
    enters = maximum(minimum(a, b), 0.0)
    leaves = minimum(maximum(a, b), 1.0)

    # The ends of that part, across the slab's axis
    ya = y0 + enters * (y1 - y0)
    yb = y0 + leaves * (y1 - y0)
    za = z0 + enters * (z1 - z0)
    zb = z0 + leaves * (z1 - z0)

    # One end lies outside the shaft, and not both lie beyond the same outer edge
    outside_y = maximum(abs(ya), abs(yb)) - row.free_y
    outside_z = maximum(abs(za), abs(zb)) - row.free_z
    off_shaft = maximum(outside_y, outside_z) > 0.0
    across = (minimum(ya, yb) < row.out_y) & (maximum(ya, yb) > -row.out_y)
    upright = (minimum(za, zb) < row.out_z) & (maximum(za, zb) > -row.out_z)
    return (enters < leaves) & off_shaft & across & upright


def touches_round(p0, p1, row):
    """Return whether the line from p0 to p1 touches a slab with a rectangular or round outline.

    In addition to the test of `touches`, the line has to meet the round outline. Only courses with
    obstacles use this slower test.
    """
    s0, y0, z0 = in_slab(p0, row)
    s1, y1, z1 = in_slab(p1, row)

    # The part of the line within the box around the slab (Liang and Barsky 1984)
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

    # The point of that part that is nearest to the axis
    nearest = -(y0 * dy + z0 * dz) / (dy * dy + dz * dz)
    nearest = minimum(maximum(nearest, enters), leaves)
    y = y0 + nearest * dy
    z = z0 + nearest * dz
    return touches(p0, p1, row) & (enters < leaves) & (y * y + z * z < row.radius2)


def away_from_zero(d):
    """Return a difference that is safe as a divisor [m]."""
    return where(abs(d) < 1e-6, 1e-6, d)


def inner_margin(gate: Gate, radius: float) -> float:
    """Return the safety margin inside the opening of a gate for a vehicle of this radius [m]."""
    return margin_inside(free_half_sizes(gate.opening, radius), SAFETY_MARGIN)


def course_obstacles(course: Course, radius: float) -> Obstacles:
    """Return the frames, each once, and the obstacles of a course as obstacles for samples.

    The tested lines deviate from the flown curve by .008 m at 40 m/s^2 over .04 s. Only half of the
    safety margin is used here, so that a gate pass within the racing cost's limits is no crash.

    Args:
        course: the course with gates and obstacles.
        radius: radius of the vehicle [m].
    """
    with_margins = _table(course, radius, inner_share=0.5, outer=SAFETY_MARGIN / 2)
    bare = _table(course, radius, inner_share=0.0, outer=0.0)
    test = touches_round if course.obstacles else touches
    near = partial(in_reach, test, with_margins, bare)
    return Obstacles(touches=test, row=ObstacleRow, rows=with_margins, near=near)


def _table(course: Course, radius: float, inner_share: float, outer: float) -> np.ndarray:
    """Return the rows of all frames and obstacles of a course.

    Args:
        course: its gates, whose frames have one row each, and its obstacles.
        radius: radius of the vehicle [m].
        inner_share: share of the safety margin that is used inside openings.
        outer: margin around frames and obstacles [m].
    """
    rows = []
    for gate in frames(course.gates):
        inner = inner_share * inner_margin(gate, radius)
        rows.append(frame_row(gate, radius, inner, outer))
    others = [obstacle_row(obstacle, radius + outer) for obstacle in course.obstacles]
    return as_rows([*rows, *others], ObstacleRow)


def obstacle_rows(obstacles: Sequence[Obstacle], grown: float) -> np.ndarray:
    """Return the rows of obstacles, grown by this much on all sides [m].  (obstacles, 24)"""
    return as_rows([obstacle_row(obstacle, grown) for obstacle in obstacles], ObstacleRow)


def obstacle_row(obstacle: Obstacle, grown: float) -> ObstacleRow:
    """Return the row of one obstacle, grown by this much on all sides [m]."""
    if isinstance(obstacle, Cylinder):
        axes = UPRIGHT
        half, out_y, out_z = obstacle.height / 2, obstacle.radius, obstacle.radius
        radius2 = (obstacle.radius + grown) ** 2
    else:
        axes = obstacle.axes
        half, out_y, out_z = obstacle.half
        radius2 = NOT_ROUND
    corners = obstacle.corners()
    return _slab_row(
        low=corners.min(axis=0) - grown,
        high=corners.max(axis=0) + grown,
        centre=obstacle.centre,
        axes=axes,
        half=half + grown,
        free=NO_SHAFT,
        out=HalfSizes(out_y + grown, out_z + grown),
        radius2=radius2,
    )


def frame_row(gate: Gate, radius: float, inner: float, outer: float) -> ObstacleRow:
    """Return the row of a gate's frame, grown by the radius of the vehicle and by margins.

    Args:
        gate: the gate.
        radius: radius of the vehicle [m].
        inner: margin inside the opening [m].
        outer: margin around the frame, and before and behind it [m].
    """
    out = outer_half_sizes(gate.opening, gate.frame_width, radius, outer)
    half = half_depth(radius, outer, gate.frame_depth)

    # The axis-aligned bounding box of the grown frame
    centre = np.array(gate.position)
    reach = abs(gate.rotation) @ np.array([half, out.left, out.up])
    return _slab_row(
        low=centre - reach,
        high=centre + reach,
        centre=gate.position,
        axes=gate.axes,
        half=half,
        free=free_half_sizes(gate.opening, radius, inner),
        out=out,
        radius2=NOT_ROUND,
    )


def _slab_row(
    low: np.ndarray,
    high: np.ndarray,
    centre: Vec3,
    axes: tuple[Vec3, Vec3, Vec3],
    half: float,
    free: HalfSizes,
    out: HalfSizes,
    radius2: float,
) -> ObstacleRow:
    """Return the row of a slab with a shaft.

    Args:
        low: lower corner of the axis-aligned bounding box [m]  (3,).
        high: upper corner of the bounding box [m]  (3,).
        centre: centre of the slab [m].
        axes: unit vectors along the slab's axis, left and up.
        half: half of the slab's depth [m].
        free: half sizes of the shaft [m].
        out: half sizes of the slab [m].
        radius2: square of the radius of the outline [m^2].
    """
    x_low, y_low, z_low = low.tolist()
    x_high, y_high, z_high = high.tolist()
    box = (x_low, y_low, z_low, x_high, y_high, z_high)
    along, left, up = axes
    return ObstacleRow(
        *box,
        *centre,
        *along,
        *left,
        *up,
        half=half,
        free_y=free.left,
        free_z=free.up,
        out_y=out.left,
        out_z=out.up,
        radius2=radius2,
    )


def in_reach(
    test: Callable,
    rows: np.ndarray,
    bare: np.ndarray,
    x: np.ndarray,
    seconds: float,
) -> np.ndarray:
    """Return the rows that can be reached from x in this time.

    If x lies within the margin of a row, the row is returned without its margin.

    Args:
        test: `touches` or `touches_round`.
        rows: frames and obstacles, with their margins.
        bare: the same rows without margins.
        x: state, position and velocity first [m, m/s].
        seconds: time [s].

    Returns:
        (near rows, 24)
    """
    p = x[:3]
    way = x[3:6] * seconds
    turn = 0.5 * ACCELERATION * seconds**2

    # Bounding boxes that meet the vehicle's straight path, widened by its reach to either side
    box_low = columns(rows, ObstacleRow, "x_low", "z_low")
    box_high = columns(rows, ObstacleRow, "x_high", "z_high")
    low = box_low - np.maximum(way, 0.0) - turn
    high = box_high - np.minimum(way, 0.0) + turn
    x_near, y_near, z_near = ((low <= p) & (p <= high)).T
    near = np.flatnonzero(x_near & y_near & z_near)
    found = rows[near]

    # A vehicle that touches a row is already within the row's margin
    inside = ((box_low[near] <= p) & (p <= box_high[near])).all(axis=1)
    for k in near[inside]:
        if test(p, p, ObstacleRow(*rows[k])):
            found[near == k] = bare[k]
    return found
