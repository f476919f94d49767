"""What is to be flown in the least time: targets in their order, from rest or as a closed lap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import dist, sqrt
from typing import Literal

from quadsim.course import Course, Gate, Obstacle, Start
from quadsim.course.opening import HalfSizes, free_half_sizes, half_depth, margin_inside
from quadsim.rotation import Vec3

MARGIN = 2e-3  # kept to frames, ground and bounds, as the path is bent between two nodes [m]
GROUND = 1e-3  # [m] between sphere and ground: closer is a crash to the referee
PAST = 1e-4  # behind the last gate's plane, where a race ends: on it, rounding would decide [m]
INSIDE, FINISH = 3, 2  # intervals from a gate's entry to its exit, and to the plane of the last one


@dataclass(frozen=True)
class Waypoint:
    """A ball that the path has to touch."""

    position: Vec3  # [m]
    tolerance: float  # radius [m]


@dataclass(frozen=True)
class Task:
    """Targets in order, laps unrolled, for a sphere of this radius [m]."""

    targets: tuple[Gate | Waypoint, ...]
    start: Start | None  # None: a closed lap, which begins as it ends, at the last target
    bounds: tuple[tuple[float, float], ...]  # x, y, z of the sphere's centre [m]
    radius: float = 0.0
    end: Vec3 | None = None  # where to come to rest after the last target [m]
    obstacles: tuple[Obstacle, ...] = ()
    margin: float = 0.0  # kept to the frames within openings, in narrow ones half of the room [m]

    @property
    def points(self) -> list[Vec3]:
        """Where the segments between targets begin and end [m]."""
        first = self.start.position if self.start else self.targets[-1].position
        return [first, *(t.position for t in self.targets), *([self.end] if self.end else [])]


def race_task(
    course: Course, radius: float, laps: int, closed: bool = False, margin: float = 0.0
) -> Task:
    """The race as the referee judges it. closed: the fastest lap that could be flown for ever,
    without a start."""
    (x0, x1), (y0, y1), (z0, z1) = course.bounds
    floor = max(z0, radius + GROUND)
    bounds = tuple((low + MARGIN, high - MARGIN) for low, high in ((x0, x1), (y0, y1), (floor, z1)))
    start = None if closed else course.start
    return Task(
        course.gates * laps, start, bounds, radius, obstacles=course.obstacles, margin=margin
    )


@dataclass(frozen=True)
class Segment:
    """Intervals of equal length [s]; what has to hold at their end, and inside a gate at every
    node."""

    target: int  # index; the number of targets: the end at rest
    kind: Literal["approach", "inside", "finish", "waypoint", "rest"]
    intervals: int


def segments(task: Task, nodes: Sequence[int]) -> list[Segment]:
    """nodes: intervals on the way to each of `task.points` but the first."""
    found: list[Segment] = []
    last = len(task.targets) - 1
    for i, target in enumerate(task.targets):
        if isinstance(target, Waypoint):
            found.append(Segment(i, "waypoint", nodes[i]))
            continue
        ends_here = i == last and task.start is not None and task.end is None
        found += [
            Segment(i, "approach", nodes[i]),
            Segment(i, "finish", FINISH) if ends_here else Segment(i, "inside", INSIDE),
        ]
    return found + ([Segment(last + 1, "rest", nodes[last + 1])] if task.end else [])


def reach(task: Task) -> float:
    """Return the distance from a gate's plane to its entry and exit, where the sphere is clear of
    the frame [m]."""
    return half_depth(task.radius)


def room(gate: Gate, task: Task) -> HalfSizes:
    """Return the half sizes of the opening within which the sphere's centre has to stay [m]."""
    free = free_half_sizes(gate.opening, task.radius, MARGIN)
    margin = margin_inside(free, task.margin)
    return HalfSizes(free.left - margin, free.up - margin)


def legs(task: Task) -> list[float]:
    """Straight lengths between the task's points [m]."""
    return [dist(a, b) for a, b in pairwise(task.points)]


def mesh(task: Task, intervals: float) -> list[int]:
    """Intervals to each point: so many on a leg of mean length, others by the root of theirs, as
    time goes; 6 or more.

    At the same mean acceleration the time of a leg grows with the root of its length.
    """
    lengths = legs(task)
    mean = sum(lengths) / len(lengths)
    return [max(6, round(intervals * sqrt(length / mean))) for length in lengths]
