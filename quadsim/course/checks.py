"""Checks of a course as a whole: gates, start, bounds, laps and obstacles have to fit together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from typing import Protocol

import numpy as np

from quadsim.course.gate import Gate, Start
from quadsim.course.obstacles import Obstacle
from quadsim.course.opening import InGate, half_sizes
from quadsim.course.swept_obstacles import SweptObstacle
from quadsim.files.values import FieldProblem
from quadsim.rotation import Vec3

# [m] around the start, and before and behind gates: the largest vehicle (.25) and half a bar (.05)
ROOM = 0.3
# [m]
ROUNDING = 1e-6
# Lines across an opening, and as many up, of which one has to be free.
LINES = 9


FULL_TURN = 6.3  # [rad], rounded up


class Layout(Protocol):
    """The parts of a Course that have to fit together."""

    @property
    def gates(self) -> tuple[Gate, ...]: ...

    @property
    def obstacles(self) -> tuple[Obstacle, ...]: ...

    @property
    def start(self) -> Start: ...

    @property
    def bounds(self) -> tuple[tuple[float, float], ...]: ...

    @property
    def loop(self) -> bool: ...

    @property
    def laps(self) -> int: ...


def problems(course: Layout) -> Iterator[FieldProblem]:
    """Yield all problems of a course, the most important one first."""
    if course.laps > 1 and not course.loop:
        yield FieldProblem(
            "laps", f"expected 1 on an open course (or loop: true), got {course.laps}"
        )
    for i, (axis, (low, high)) in enumerate(zip("xyz", course.bounds, strict=True)):
        if low >= high:
            problem = f"expected {axis}_min < {axis}_max [m], got [{low:g}, {high:g}]"
            yield FieldProblem(f"bounds[{i}]", problem)
    yield from _start_problems(course)
    yield from _gate_problems(course)
    yield from _obstacle_problems(course)


def looks_like_radians(degrees: Sequence[float]) -> bool:
    """Return whether angles that are given as degrees are probably radians.

    Radians are all small numbers, and some are not whole: 1.57 rather than 90. A single angle is
    never taken for radians.

    Args:
        degrees: the angles [deg].
    """
    small = all(abs(angle) <= FULL_TURN for angle in degrees)
    broken = [angle for angle in degrees if angle != round(angle)]
    return len(degrees) > 1 and small and bool(broken)


def _start_problems(course: Layout) -> Iterator[FieldProblem]:
    """Yield the problems of the start."""
    key = "start.position"
    start = course.start.position
    if start[2] < 0.0:
        yield FieldProblem(key, f"expected z >= 0, on or above the ground [m], got {start[2]:g}")
    for problem in start_problems(course, start):
        yield FieldProblem(key, problem)


def start_problems(course: Layout, start: Vec3) -> Iterator[str]:
    """Yield the reasons why a vehicle cannot start at a place: bounds, frames or obstacles.

    Args:
        course: the course.
        start: the place [m].
    """
    # The plant lifts a vehicle that starts in the ground.
    outside = _outside(course, np.array([(start[0], start[1], max(start[2], 0.0))]))
    if outside:
        yield outside

    distances = {
        f"the frame of gate {i}": gate.frame_distance(start)
        for i, gate in enumerate(course.gates, 1)
    }
    for i, obstacle in enumerate(course.obstacles, 1):
        distances[f"obstacle {i}"] = obstacle.distance(start)
    for name, distance in distances.items():
        if distance < ROOM:
            yield f"expected {ROOM} m of room, got {distance:.2f} m to {name}"


def misplaced_gates(course: Layout) -> dict[int, str]:
    """Return the problem of each gate that cannot be flown at its place, by index.

    Such a gate is outside the bounds, in the ground, blocked by obstacles, or too near to the
    start.
    """
    found = {}
    for i, gate in enumerate(course.gates):
        wrong = [problem.problem for problem in _problems_of_gate(course, i, gate)]
        distance = gate.frame_distance(course.start.position)
        if distance < ROOM:
            wrong.append(f"expected {ROOM} m of room, got {distance:.2f} m to the start")
        if course.obstacles and _blocked(gate, course.obstacles):
            wrong.append("expected a free line through the gate, got obstacles across all of it")
        if wrong:
            found[i] = wrong[0]
    return found


def _gate_problems(course: Layout) -> Iterator[FieldProblem]:
    """Yield the problems of every gate and of the free space before and behind it."""
    for i, gate in enumerate(course.gates):
        yield from _problems_of_gate(course, i, gate)


def _problems_of_gate(course: Layout, i: int, gate: Gate) -> Iterator[FieldProblem]:
    """Yield the problems of one gate, whose index is i."""
    key = f"gates[{i}].position"
    opening = gate.corners()
    lowest = opening[:, 2].min()
    if lowest < -ROUNDING:
        problem = f"expected an opening above the ground, got its lowest corner at {lowest:.2f}"
        yield FieldProblem(key, f"{problem} [m]")
    outside = _outside(course, opening)
    if outside:
        yield FieldProblem(key, outside)

    # The last gate of an open course too: a planner stays within the bounds by the vehicle's
    # size, and would not reach a gate that stands on them.
    for where, along in (("before", -ROOM), ("behind", ROOM)):
        point = gate.to_world(InGate(along, 0.0, 0.0))
        if point[2] < -ROUNDING:
            problem = f"expected {ROOM} m of room {where} the gate, got the ground nearer"
            yield FieldProblem(key, problem)
        outside = _outside(course, np.array([point]))
        if outside:
            yield FieldProblem(key, f"{ROOM} m {where} the gate, along its passage, is {outside}")


def _obstacle_problems(course: Layout) -> Iterator[FieldProblem]:
    """Yield the problems of obstacles, and a problem for each gate that they block."""
    for i, obstacle in enumerate(course.obstacles):
        key = f"obstacles[{i}]"
        if obstacle.top <= 0.0:
            problem = f"expected an obstacle above the ground, got its top at {obstacle.top:.2f}"
            yield FieldProblem(key, f"{problem} [m]")
        corners = obstacle.corners()
        spans = zip("xyz", corners.min(axis=0), corners.max(axis=0), course.bounds, strict=True)
        for axis, low, high, (least, most) in spans:
            if high < least or low > most:
                expected = f"expected {axis} within [{least:g}, {most:g}] [m]"
                got = f"got {low:.2f} to {high:.2f}"
                yield FieldProblem(key, f"outside the bounds, {expected}, {got}")
    for i, gate in enumerate(course.gates):
        if course.obstacles and _blocked(gate, course.obstacles):
            expected = f"expected a free line of {2 * ROOM:g} m through the gate"
            yield FieldProblem(f"gates[{i}]", f"{expected}, got obstacles across all of it")


def _blocked(gate: Gate, obstacles: Sequence[Obstacle]) -> bool:
    """Return whether obstacles cut every line along the passage, from before the gate to behind."""
    swept = [SweptObstacle(obstacle, k, 0.0) for k, obstacle in enumerate(obstacles)]
    half = half_sizes(gate.opening)
    # shares of the half sizes, without the edges
    shares = np.linspace(-1.0, 1.0, LINES + 2)[1:-1]
    for left, up in product((shares * half.left).tolist(), (shares * half.up).tolist()):
        before = gate.to_world(InGate(-ROOM, left, up))
        behind = gate.to_world(InGate(ROOM, left, up))
        if all(s.touch(before, behind) is None for s in swept):
            return False
    return True


def _outside(course: Layout, points: np.ndarray) -> str:
    """Return the problem with points (n, 3) that lie outside the bounds, "" if none does."""
    for axis, values, (low, high) in zip("xyz", points.T, course.bounds, strict=True):
        for value in (values.min(), values.max()):
            if not low - ROUNDING <= value <= high + ROUNDING:
                expected = f"expected {axis} within [{low:g}, {high:g}] [m]"
                return f"outside the bounds, {expected}, got {value:.2f}"
    return ""
