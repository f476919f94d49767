"""Detours: constraints that lead a solution around frames and boxes that it has hit.

A detour constrains a few nodes to a half-space, because the space around a frame or a box is not
convex. A race is first solved without detours. If the referee then finds a hit, nodes in a frame's
slab are constrained to lie before, behind or beside the slab, and nodes in a box beyond one of its
faces. The nearest side is chosen, and the race is solved again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from quadsim.course import Box, Gate
from quadsim.course.opening import half_depth, outer_half_sizes
from quadsim.dynamics.quadrotor import POSITION
from quadsim.limit.limits import Solution
from quadsim.limit.route import MARGIN, Route, Segment

# Axes of a gate's frame: passage, left and up. Axes of a box's frame: x, y and z
ALONG, LEFT, UP = 0, 1, 2
AXES = (ALONG, LEFT, UP)
SIGNS = (1.0, -1.0)


class Side(NamedTuple):
    """One of the six sides of a box around the origin of a frame."""

    # One of AXES
    axis: int
    sign: float

    def depth(self, local: np.ndarray, half: Sequence[float]) -> np.ndarray:
        """Return the depth of points (..., 3) behind this side of a box [m].  (...)

        Args:
            local: the points in the frame [m].
            half: half extents of the box [m].
        """
        return half[self.axis] - self.sign * local[..., self.axis]


class Way(NamedTuple):
    """Neighbouring nodes of a segment, first to last, which are to stay beyond a side."""

    first: int
    last: int
    side: Side


@dataclass(frozen=True)
class Detour:
    """A constraint that nodes of a segment stay beyond one side of a gate's frame or a box.

    In the axes of the gate or the box it is side.sign * local[side.axis] >= distance.
    """

    segment: int
    # Part of the segment's intervals, from 0 to 1
    part: tuple[float, float]
    gate: Gate | Box
    side: Side
    # From the centre [m]
    distance: float

    def holds_at(self, segment: int, node: int, intervals: int) -> bool:
        """Return whether the detour constrains this node of a segment with `intervals` intervals.

        A detour constrains the nodes of its part. At an edge of a frame it also constrains one node
        on either side, so that the line between two nodes stays out too.
        """
        first, last = (share * intervals for share in self.part)
        more = 0.0 if self.side.axis == ALONG else 1.0
        return segment == self.segment and first - more <= node <= last + more

    def spare(self, local: Any) -> Any:
        """Return the slack of the constraint, negative if it is violated [m].

        Args:
            local: position in the axes of the gate or the box, numbers [m] or CasADi symbols  (3,).
        """
        return self.side.sign * local[self.side.axis] - self.distance


class Hit(NamedTuple):
    """A gate or a box that was hit, and the time of the hit [s]."""

    t: float
    place: Gate | Box


def detours(
    solution: Solution, plan: Sequence[Segment], route: Route, hits: Sequence[Hit]
) -> Iterator[Detour]:
    """Yield detours around the frames and boxes that were hit.

    Args:
        solution: the solution with the hits.
        plan: segments of the route.
        route: gates of the race and radius of the vehicle's sphere.
        hits: hit gates and boxes with their times.
    """
    # Index of the node at which each segment begins
    begins = np.cumsum([0, *(segment.intervals for segment in plan)])
    for t, place in hits:
        k = int(np.searchsorted(begins, np.searchsorted(solution.t, t))) - 1
        if plan[k].kind != "approach":
            continue
        # The nodes of the segment in the frame of the hit object, and the node of the hit
        own = slice(begins[k], begins[k + 1])
        local = (solution.x[own, POSITION] - place.position) @ np.array(place.axes).T
        hit = min(int(np.searchsorted(solution.t[own], t)), len(local) - 1)
        if isinstance(place, Box):
            half = [extent + route.radius for extent in place.half]
            ways = [_way_out_of_a_box(local, hit, half)]
        else:
            outer = outer_half_sizes(place.opening, place.frame_width, route.radius)
            half = [half_depth(route.radius, depth=place.frame_depth), outer.left, outer.up]
            ways = _ways_out_of_a_frame(local, hit, half)
        intervals = plan[k].intervals
        for way in ways:
            yield Detour(
                segment=k,
                part=((way.first - 0.5) / intervals, (way.last + 0.5) / intervals),
                gate=place,
                side=way.side,
                distance=half[way.side.axis] + MARGIN,
            )


def _ways_out_of_a_frame(local: np.ndarray, hit: int, half: Sequence[float]) -> Iterator[Way]:
    """Yield the nearest side of a frame for each run of nodes in its slab.

    The sides are the slab's two faces and the edge of the frame nearest to all nodes in the slab.

    Args:
        local: nodes of the segment in the gate's frame [m].  (nodes, 3)
        hit: index of the node at which the frame was hit.
        half: half extents of the slab that the frame fills, grown by the sphere [m].  (3,)
    """
    first, last = _within(abs(local[:, ALONG]) <= half[ALONG], hit)
    edges = [Side(axis, sign) for axis in (LEFT, UP) for sign in SIGNS]
    edge = _nearest_side(edges, local[first : last + 1], half)

    # Each node in the slab, and one on either side of the slab, leaves by its nearest side
    sides = [Side(ALONG, 1.0), Side(ALONG, -1.0), edge]
    nodes = range(max(first - 1, 1), min(last + 2, len(local)))
    nearest = [_nearest_side(sides, local[n : n + 1], half) for n in nodes]

    # A path from one face of the slab to the other leads past the edge
    for i in range(len(nearest) - 1):
        on_faces = nearest[i].axis == nearest[i + 1].axis == ALONG
        if on_faces and nearest[i] != nearest[i + 1]:
            nearest[i] = edge
            nearest[i + 1] = edge

    for side, run in groupby(zip(nearest, nodes, strict=True), key=itemgetter(0)):
        found = [node for _, node in run]
        yield Way(found[0], found[-1], side)


def _way_out_of_a_box(local: np.ndarray, hit: int, half: Sequence[float]) -> Way:
    """Return the side of a box that is nearest to the deepest node, for all nodes in the box.

    Args:
        local: nodes of the segment in the frame of the box [m].  (nodes, 3)
        hit: index of the node at which the box was hit.
        half: half extents of the box, grown by the sphere [m].  (3,)
    """
    first, last = _within(np.all(abs(local) <= half, axis=1), hit)
    faces = [Side(axis, sign) for axis in AXES for sign in SIGNS]
    side = _nearest_side(faces, local[first : last + 1], half)
    return Way(max(first - 1, 1), min(last + 1, len(local) - 1), side)


def _nearest_side(sides: Sequence[Side], local: np.ndarray, half: Sequence[float]) -> Side:
    """Return the side for which the largest depth of the points (n, 3) is smallest.

    If several sides are equal, the first is returned.
    """
    deepest = [float(side.depth(local, half).max()) for side in sides]
    return sides[int(np.argmin(deepest))]


def _within(inside: np.ndarray, node: int) -> tuple[int, int]:
    """Return the first and the last node of the run of inside nodes around a node.

    If no neighbour is inside, both are the node itself.
    """
    first = node
    last = node
    while first > 0 and inside[first - 1]:
        first -= 1
    while last + 1 < len(inside) and inside[last + 1]:
        last += 1
    return first, last
