"""The geometry of a gate's opening and of the frame around it, for a sphere that flies through.

Everything here is given in the gate's frame: x along the legal passage, y to the left, z up, from
the centre of the opening. Seen from above, the passage leads to the right and z points out of the
picture:

                 entry plane                    exit plane
    left (y)     along = -half_depth            along = half_depth
       ^                |                              |
       |          . . . | . . . . . . . . . . . . . . .|. . .   outer.left: end of the slab
       |                |                              |           ^ radius + margin
       |                |       +--------------+       |           v
       |                |       |     bar      |       |        outer edge of the frame
       |                |       | of the frame |       |           frame_width
       |                |       +--------------+       |        half.left: edge of the opening
       |                |                              |           ^ radius + margin
       |          . . . | . . . . . . . . . . . . . . .|. . .      v
       |                |                              |        free.left
       +----------------|--------------0---------------|-------------> along (x)
                        |          the gate's          |
          in front of it|             plane            |behind it

    half        half sizes of the opening
    free        half sizes within which the sphere's centre is free, negative if the sphere does
                not fit
    outer       half sizes outside which the sphere's centre is free
    half_depth  distance from the gate's plane to its entry and exit plane, in which the sphere is
                clear of the frame
    slab        the space between entry and exit plane, within outer: in it and outside free, the
                sphere touches a bar
    on passage  in the opening or on the frame: a crossing of the plane there counts for this gate
    beyond      how far outside a rectangle of half sizes a point is, negative inside
"""

from __future__ import annotations

from itertools import product
from math import hypot
from typing import NamedTuple

import numpy as np

from quadsim.rotation import Vec3

# [m] of a gate's bars along its passage, unless its course says otherwise
FRAME_DEPTH = 0.1


class Offset(NamedTuple):
    """A point in the plane of a gate, from the centre of the opening [m]."""

    left: float
    up: float


class InGate(NamedTuple):
    """A point in the frame of a gate [m]."""

    # from the plane along the passage, negative in front of the gate
    along: float
    left: float
    up: float

    @property
    def offset(self) -> Offset:
        """The point, projected along the passage onto the plane of the gate."""
        return Offset(self.left, self.up)


class HalfSizes(NamedTuple):
    """A rectangle around the centre of an opening, by half its width and half its height [m]."""

    left: float
    up: float


class Crossing(NamedTuple):
    """The point at which a segment crosses the plane of a gate."""

    # share of the segment before the crossing
    fraction: float
    # from the centre of the opening [m]
    offset: Offset
    # whether it leads along the passage, from in front of the gate to behind it
    forward: bool


class Bar(NamedTuple):
    """One of the four bars of a frame, a box in the frame of the gate [m]."""

    centre: Vec3
    # half extents
    half: Vec3


def half_sizes(opening: tuple[float, float]) -> HalfSizes:
    """Return the half sizes of an opening of this width and height [m]."""
    width, height = opening
    return HalfSizes(width / 2, height / 2)


def free_half_sizes(opening: tuple[float, float], radius: float, margin: float = 0.0) -> HalfSizes:
    """Return the half sizes within which a sphere's centre is free of the frame [m].

    They are negative if the sphere does not fit.

    Args:
        opening: width and height [m].
        radius: radius of the sphere [m].
        margin: kept between the sphere and the edges of the opening [m].
    """
    half = half_sizes(opening)
    return HalfSizes(half.left - radius - margin, half.up - radius - margin)


def outer_half_sizes(
    opening: tuple[float, float], frame_width: float, radius: float = 0.0, margin: float = 0.0
) -> HalfSizes:
    """Return the half sizes outside which a sphere's centre is free of the frame [m].

    Without radius and margin these are the half sizes of the frame itself, from outer edge to outer
    edge.

    Args:
        opening: width and height [m].
        frame_width: width of the bars around the opening [m].
        radius: radius of the sphere [m].
        margin: kept between the sphere and the frame [m].
    """
    half = half_sizes(opening)
    return HalfSizes(
        left=half.left + frame_width + radius + margin,
        up=half.up + frame_width + radius + margin,
    )


def half_depth(radius: float, margin: float = 0.0, depth: float = FRAME_DEPTH) -> float:
    """Return the distance from a gate's plane to its entry and exit plane [m].

    There a sphere is clear of the frame.

    Args:
        radius: radius of the sphere [m].
        margin: kept between the sphere and the frame [m].
        depth: depth of the frame along the passage [m].
    """
    return depth / 2 + radius + margin


def margin_inside(free: HalfSizes, wanted: float) -> float:
    """Return the margin to keep inside a free opening, at most half of its room [m].

    Args:
        free: half sizes within which the sphere's centre is free [m].
        wanted: the margin to keep if there is room for it [m].
    """
    return min(wanted, min(free) / 2)


def approach_length(opening: tuple[float, float]) -> float:
    """Return the length of a gate's approach: the larger of its width and height [m]."""
    return max(opening)


def beyond(offset: Offset, half: HalfSizes) -> float:
    """Return max(|y| - half_y, |z| - half_z), how far outside a rectangle a point is [m].

    It is negative inside.
    """
    return max(abs(offset.left) - half.left, abs(offset.up) - half.up)


def on_passage(offset: Offset, opening: tuple[float, float], frame_width: float) -> bool:
    """Return whether a point of the plane lies in the opening or on the frame.

    This decides which crossings of the plane belong to the gate; contacts with the frame are found
    by `SweptGate.touch`.
    """
    return beyond(offset, half_sizes(opening)) <= frame_width


def in_front(p: InGate) -> bool:
    """Return whether a point is in front of the gate; its plane belongs to the side behind it."""
    return p.along < 0.0


def between(a: InGate, b: InGate, fraction: float) -> InGate:
    """Return the point at this fraction of the segment from a to b."""
    return InGate(
        a.along + fraction * (b.along - a.along),
        a.left + fraction * (b.left - a.left),
        a.up + fraction * (b.up - a.up),
    )


def crossing(a: InGate, b: InGate) -> Crossing | None:
    """Return the crossing of the gate's plane by the segment from a to b, None if there is none.

    The plane belongs to the side behind the gate, so a path with a vertex on the plane crosses it
    only once.
    """
    if in_front(a) == in_front(b):
        return None
    fraction = a.along / (a.along - b.along)
    return Crossing(fraction, between(a, b, fraction).offset, forward=in_front(a))


def distance_to_frame(p: InGate, opening: tuple[float, float], frame_width: float) -> float:
    """Return the distance from a point to the nearest bar of the frame [m].

    Bars are taken as flat; the distance is 0 on a bar.
    """
    outside = beyond(p.offset, half_sizes(opening))
    if outside < 0.0:
        # Before or behind the opening, the nearest edge is as far away as the point is inside it.
        return hypot(p.along, outside)
    outer = outer_half_sizes(opening, frame_width)
    past_left = max(abs(p.left) - outer.left, 0.0)
    past_up = max(abs(p.up) - outer.up, 0.0)
    return hypot(p.along, past_left, past_up)


def rectangle_corners(half: HalfSizes) -> np.ndarray:
    """Return the corners of a rectangle in the plane [m].

    Returns:
        Lower right, upper right, lower left and upper left corner  (4, 3).
    """
    return np.array(
        [(0.0, left * half.left, up * half.up) for left, up in product((-1, 1), repeat=2)]
    )


def frame_bars(
    opening: tuple[float, float], frame_width: float, depth: float = FRAME_DEPTH
) -> tuple[Bar, Bar, Bar, Bar]:
    """Return the four bars of a frame.

    The beams at top and bottom span the corners; the posts stand between them.
    """
    width, height = opening
    across = (width + frame_width) / 2
    up = (height + frame_width) / 2
    beam = (depth / 2, width / 2 + frame_width, frame_width / 2)
    post = (depth / 2, frame_width / 2, height / 2)
    return (
        Bar((0.0, 0.0, up), beam),
        Bar((0.0, 0.0, -up), beam),
        Bar((0.0, across, 0.0), post),
        Bar((0.0, -across, 0.0), post),
    )
