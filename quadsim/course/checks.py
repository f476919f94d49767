"""Whether gates, start, bounds, laps and obstacles of a course fit together: what no single key can
show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

from quadsim.course.course import Course, Gate
from quadsim.course.obstacles import Obstacle
from quadsim.course.opening import InGate, half_sizes
from quadsim.course.swept_obstacles import SweptObstacle

# around the start, and before and behind gates [m]: the largest vehicle (.25) and half a bar (.05)
ROOM = 0.3
ROUNDING = 1e-6  # [m]
LINES = 9  # across an opening, and as many up, of which one has to be free

Fault = tuple[str, str]  # key in the file, problem


def faults(course: Course) -> Iterator[Fault]:
    """The first is the one to show."""
    if course.laps > 1 and not course.loop:
        yield "laps", f"expected 1 on an open course (or loop: true), got {course.laps}"
    for i, (axis, (low, high)) in enumerate(zip("xyz", course.bounds, strict=True)):
        if low >= high:
            yield f"bounds[{i}]", f"expected {axis}_min < {axis}_max [m], got [{low:g}, {high:g}]"
    yield from _start_faults(course)
    yield from _gate_faults(course)
    yield from _obstacle_faults(course)


def _start_faults(course: Course) -> Iterator[Fault]:
    start = course.start.position
    if start[2] < 0.0:
        yield "start.position", f"expected z >= 0, on or above the ground [m], got {start[2]:g}"
    if outside := _outside(course, np.array([start])):
        yield "start.position", outside
    near = [
        (gate.frame_distance(start), f"the frame of gate {i}")
        for i, gate in enumerate(course.gates, 1)
    ]
    near += [
        (obstacle.distance(start), f"obstacle {i}")
        for i, obstacle in enumerate(course.obstacles, 1)
    ]
    for room, what in near:
        if room < ROOM:
            yield "start.position", f"expected {ROOM} m of room, got {room:.2f} m to {what}"


def _gate_faults(course: Course) -> Iterator[Fault]:
    for i, gate in enumerate(course.gates):
        key, opening = f"gates[{i}].position", gate.corners()
        before = gate.to_world(InGate(-ROOM, 0.0, 0.0))
        behind = gate.to_world(InGate(ROOM, 0.0, 0.0))
        if (low := opening[:, 2].min()) < -ROUNDING:
            yield (
                key,
                f"expected an opening above the ground, its lowest corner is at z = {low:.2f} m",
            )
        if outside := _outside(course, opening):
            yield key, outside
        for where, point in (("before", before), ("behind", behind)):
            if point[2] < -ROUNDING:
                yield (
                    key,
                    f"expected {ROOM} m of room {where} the gate, the ground is nearer than that",
                )
            ends = point is behind and i == len(course.gates) - 1 and not course.loop
            if not ends and (outside := _outside(course, np.array([point]))):
                yield key, f"{ROOM} m {where} the gate, along its passage, is {outside}"


def _obstacle_faults(course: Course) -> Iterator[Fault]:
    for i, obstacle in enumerate(course.obstacles):
        if obstacle.top <= 0.0:
            yield (
                f"obstacles[{i}]",
                f"expected an obstacle above the ground, its top is at z = {obstacle.top:.2f} m",
            )
        low, high = obstacle.corners().min(axis=0), obstacle.corners().max(axis=0)
        for axis, a, b, (least, most) in zip("xyz", low, high, course.bounds, strict=True):
            if b < least or a > most:
                yield (
                    f"obstacles[{i}]",
                    f"outside the bounds, expected {axis} within [{least:g}, {most:g}] [m], got {a:.2f} to {b:.2f}",
                )
    for i, gate in enumerate(course.gates):
        if course.obstacles and _blocked(gate, course.obstacles):
            yield (
                f"gates[{i}]",
                f"expected a free line of {2 * ROOM:g} m through the gate, obstacles leave none",
            )


def _blocked(gate: Gate, obstacles: Sequence[Obstacle]) -> bool:
    """Whether no straight line along the passage, from before the gate to behind it, is clear of
    all of them."""
    swept = [SweptObstacle(obstacle, k, 0.0) for k, obstacle in enumerate(obstacles)]
    half = half_sizes(gate.opening)
    shares = np.linspace(-1.0, 1.0, LINES + 2)[1:-1]  # of the half sizes, the edges left out
    for left, up in product((shares * half.left).tolist(), (shares * half.up).tolist()):
        before = gate.to_world(InGate(-ROOM, left, up))
        behind = gate.to_world(InGate(ROOM, left, up))
        if all(s.touch(before, behind) is None for s in swept):
            return False
    return True


def _outside(course: Course, points: np.ndarray) -> str:
    """Which bound the first of the points lies beyond, or "".  points: (n, 3)"""
    for axis, values, (low, high) in zip("xyz", points.T, course.bounds, strict=True):
        for v in (values.min(), values.max()):
            if not low - ROUNDING <= v <= high + ROUNDING:
                return f"outside the bounds, expected {axis} within [{low:g}, {high:g}] [m], got {v:.2f}"
    return ""
