"""What no single key can show: whether gates, start, bounds and laps fit together."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, radians

import numpy as np

from quadsim.course.course import Course

Fault = tuple[str, str]  # key in the file, problem
START_ROOM = 0.3  # around the start, free of gate frames [m]: the largest vehicle (.25) and half a bar (.05)
ROUNDING = 1e-6  # [m]
SAME_PLACE, SAME_WAY = 0.01, cos(radians(5.0))  # gates closer than this [m, cos] are one gate written twice


def faults(course: Course) -> Iterator[Fault]:
    """Everything that is wrong with a course, the first thing first."""
    if course.laps > 1 and not course.loop:
        yield "laps", f"expected 1 on an open course (or loop: true), got {course.laps}"
    for i, (axis, (low, high)) in enumerate(zip("xyz", course.bounds, strict=True)):
        if low >= high:
            yield f"bounds[{i}]", f"expected {axis}_min < {axis}_max [m], got [{low:g}, {high:g}]"
    yield from _start_faults(course)
    yield from _gate_faults(course)


def _start_faults(course: Course) -> Iterator[Fault]:
    start = course.start.position
    if start[2] < 0.0:
        yield "start.position", f"expected z >= 0, on or above the ground [m], got {start[2]:g}"
    if outside := _outside(course, np.array([start])):
        yield "start.position", outside
    for i, gate in enumerate(course.gates, start=1):
        if (room := gate.frame_distance(start)) < START_ROOM:
            yield "start.position", f"expected {START_ROOM} m of room, got {room:.2f} m to the frame of gate {i}"


def _gate_faults(course: Course) -> Iterator[Fault]:
    centres = np.array([g.position for g in course.gates])  # (gates, 3)
    passages = np.array([g.rotation[:, 0] for g in course.gates])  # (gates, 3)
    for i, gate in enumerate(course.gates):
        key, opening = f"gates[{i}].position", gate.corners()
        if (low := opening[:, 2].min()) < -ROUNDING:
            yield key, f"expected an opening above the ground, its lowest corner is at z = {low:.2f} m"
        if outside := _outside(course, opening):
            yield key, outside
        near = np.linalg.norm(centres[:i] - centres[i], axis=1) < SAME_PLACE
        twins = np.flatnonzero(near & (passages[:i] @ passages[i] > SAME_WAY))
        if twins.size:
            yield key, f"the same place and direction as gate {twins[0] + 1} (gates count from 1): remove one"


def _outside(course: Course, points: np.ndarray) -> str:
    """Which bound the first of the points lies beyond, or "".  points: (n, 3)"""
    for axis, values, (low, high) in zip("xyz", points.T, course.bounds, strict=True):
        for v in (values.min(), values.max()):
            if not low - ROUNDING <= v <= high + ROUNDING:
                return f"outside the bounds, expected {axis} within [{low:g}, {high:g}] [m], got {v:.2f}"
    return ""
