"""The route of a race: its gates in order, from rest or as a closed lap, and its segments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import dist, sqrt
from typing import Literal

from quadsim.course import Gate, Obstacle, Start
from quadsim.course.opening import HalfSizes, free_half_sizes, half_depth, margin_inside
from quadsim.limit.limits import LimitProblem
from quadsim.rotation import Vec3

# Margin to frames, ground and bounds, as the path is curved between two nodes [m]
MARGIN = 2e-3
# Clearance between sphere and ground; below it the referee reports a crash [m]
GROUND = 1e-3
# Distance of the end of a race behind the last gate's plane, against rounding [m]
PAST = 1e-4
# Intervals from a gate's entry to its exit, and from the last gate's entry to its plane
INSIDE = 3
FINISH = 2
# Smallest number of intervals to a gate
FEWEST = 6


@dataclass(frozen=True)
class Route:
    """The gates to pass, in all laps, and the free space in them for the vehicle's sphere."""

    gates: tuple[Gate, ...]
    # None: a closed lap, which begins at the last gate in the state in which it ends
    start: Start | None
    # Ranges of x, y and z of the sphere's centre [m]
    bounds: tuple[tuple[float, float], ...]
    # Radius of the sphere [m]
    radius: float = 0.0
    obstacles: tuple[Obstacle, ...] = ()
    # Margin to the frames within openings; in narrow openings half of the room [m]
    margin: float = 0.0

    @classmethod
    def of(cls, problem: LimitProblem) -> Route:
        """Return the route of a problem under the referee's rules.

        A closed route is a lap without a start, which can be repeated for ever.
        """
        course = problem.course
        radius = problem.vehicle.radius
        x_range, y_range, (z_min, z_max) = course.bounds
        floor = max(z_min, radius + GROUND)
        ranges = (x_range, y_range, (floor, z_max))
        return cls(
            gates=course.gates * problem.laps,
            start=None if problem.closed else course.start,
            bounds=tuple((low + MARGIN, high - MARGIN) for low, high in ranges),
            radius=radius,
            obstacles=course.obstacles,
            margin=problem.margin,
        )

    @property
    def points(self) -> list[Vec3]:
        """The start and the gates' centres, in the order of the flight [m]."""
        first = self.start.position if self.start else self.gates[-1].position
        return [first, *(gate.position for gate in self.gates)]

    @property
    def legs(self) -> list[float]:
        """The straight distances between consecutive points [m]."""
        return [dist(a, b) for a, b in pairwise(self.points)]

    @property
    def reach(self) -> float:
        """The distance from a gate's plane to its entry and exit, where the sphere is clear [m]."""
        # The frames of a course have the same depth, except for a gate with its own depth.
        return half_depth(self.radius, depth=max(gate.frame_depth for gate in self.gates))

    def room(self, gate: Gate) -> HalfSizes:
        """Return the half sizes of the opening for the sphere's centre [m]."""
        free = free_half_sizes(gate.opening, self.radius, MARGIN)
        margin = self.margin_in(gate)
        return HalfSizes(free.left - margin, free.up - margin)

    def margin_in(self, gate: Gate) -> float:
        """Return the margin to the frame within a gate's opening [m]."""
        return margin_inside(free_half_sizes(gate.opening, self.radius, MARGIN), self.margin)

    @property
    def least_margin(self) -> float:
        """The margin to the frame in the narrowest opening [m]."""
        return min(map(self.margin_in, self.gates))

    def mesh(self, intervals: float) -> list[int]:
        """Return the number of intervals on each leg.

        A leg of mean length has `intervals` intervals. The number grows with the square root of a
        leg's length, like the time at a given mean acceleration.
        """
        mean = sum(self.legs) / len(self.legs)
        return [max(FEWEST, round(intervals * sqrt(leg / mean))) for leg in self.legs]


@dataclass(frozen=True)
class Segment:
    """A part of a route with intervals of equal length.

    It ends at a gate's entry, at its exit, or in the last gate's plane. The kind names the
    constraint at this end and, inside a gate, at every node.
    """

    # Index of the gate
    target: int
    kind: Literal["approach", "inside", "finish"]
    intervals: int


def segments(route: Route, intervals: Sequence[int]) -> list[Segment]:
    """Return the segments of a route in order.

    Args:
        route: the gates.
        intervals: number of intervals on each of the route's legs.
    """
    found: list[Segment] = []
    last = len(route.gates) - 1
    for i in range(len(route.gates)):
        found.append(Segment(i, "approach", intervals[i]))
        if i == last and route.start is not None:
            found.append(Segment(i, "finish", FINISH))
        else:
            found.append(Segment(i, "inside", INSIDE))
    return found
