"""Route: the gates of a race in their order, from rest or as a closed lap, and its segments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import dist, sqrt
from typing import Literal

from quadsim.course import Gate, Obstacle, Start
from quadsim.course.opening import HalfSizes, free_half_sizes, half_depth, margin_inside
from quadsim.record.limits import LimitProblem
from quadsim.rotation import Vec3

# Kept to frames, ground and bounds, as the path is bent between two nodes [m]
MARGIN = 2e-3
# Between sphere and ground: the referee calls anything closer a crash [m]
GROUND = 1e-3
# Distance behind the last gate's plane where a race ends: on it, rounding would decide [m]
PAST = 1e-4
# Intervals from a gate's entry to its exit, and from the entry of the last one to its plane
INSIDE = 3
FINISH = 2
# Intervals to a gate, at least
FEWEST = 6


@dataclass(frozen=True)
class Route:
    """The gates to pass, laps unrolled, and the space for a sphere."""

    gates: tuple[Gate, ...]
    # None: a closed lap, which begins as it ends, at the last gate
    start: Start | None
    # Ranges of x, y and z of the sphere's centre [m]
    bounds: tuple[tuple[float, float], ...]
    # Radius of the sphere [m]
    radius: float = 0.0
    obstacles: tuple[Obstacle, ...] = ()
    # Kept to the frames within openings, in narrow ones half of the room [m]
    margin: float = 0.0

    @classmethod
    def of(cls, problem: LimitProblem) -> Route:
        """Return the route of a problem, as the referee judges it.

        A closed one is the fastest lap that could be flown for ever, without a start.
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
        """The places between which the vehicle flies: its start, and the gates' centres [m]."""
        first = self.start.position if self.start else self.gates[-1].position
        return [first, *(gate.position for gate in self.gates)]

    @property
    def legs(self) -> list[float]:
        """The straight lengths between the points [m]."""
        return [dist(a, b) for a, b in pairwise(self.points)]

    @property
    def reach(self) -> float:
        """The distance of a gate's entry and exit from its plane; the sphere is clear there [m]."""
        return half_depth(self.radius)

    def room(self, gate: Gate) -> HalfSizes:
        """Return half sizes of the opening within which the sphere's centre has to stay [m]."""
        free = free_half_sizes(gate.opening, self.radius, MARGIN)
        margin = self.margin_in(gate)
        return HalfSizes(free.left - margin, free.up - margin)

    def margin_in(self, gate: Gate) -> float:
        """Return the distance kept to the frame within a gate's opening [m]."""
        return margin_inside(free_half_sizes(gate.opening, self.radius, MARGIN), self.margin)

    @property
    def least_margin(self) -> float:
        """The distance kept to the frame in the narrowest opening [m]."""
        return min(map(self.margin_in, self.gates))

    def mesh(self, intervals: float) -> list[int]:
        """Return the number of intervals on each leg.

        A leg of mean length has `intervals`. The number grows with the root of a leg's length, as
        the time does at the same mean acceleration.
        """
        mean = sum(self.legs) / len(self.legs)
        return [max(FEWEST, round(intervals * sqrt(leg / mean))) for leg in self.legs]


@dataclass(frozen=True)
class Segment:
    """Intervals of equal length: towards a gate's entry, inside it, or to the plane of the last.

    The name of its kind says what holds at its end, and inside a gate at every node.
    """

    # Index of the gate
    target: int
    kind: Literal["approach", "inside", "finish"]
    intervals: int


def segments(route: Route, intervals: Sequence[int]) -> list[Segment]:
    """Return the segments of a route in order.

    Args:
        route: the gates.
        intervals: on each of the route's legs.
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
