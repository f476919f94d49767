"""Find points that a frame or an obstacle hides from the camera.

A line of sight is the path of a sphere of radius 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np

from quadsim.course import Gate
from quadsim.course.obstacles import Obstacle
from quadsim.course.swept import SweptGate
from quadsim.course.swept_obstacles import SweptObstacle

# Share of a line of sight: a frame that begins in the point itself does not hide it.
BEFORE = 1.0 - 1e-6


# cached, as every picture uses the same few gates
@lru_cache(1024)
def _frame(gate: Gate) -> SweptGate:
    """Return the frame of a gate, swept by a sphere of radius 0."""
    return SweptGate(gate, 0, 0.0)


def hidden(
    points: np.ndarray, eye: np.ndarray, gates: Iterable[Gate], obstacles: Iterable[Obstacle] = ()
) -> np.ndarray:
    """Return which points are hidden from the camera by a bar of any gate or any obstacle.

    Args:
        points: points in the world [m]  (n, 3).
        eye: position of the camera in the world [m]  (3,).
        gates: gates, whose frames may hide points.
        obstacles: obstacles, which may hide points.

    Returns:
        Whether each point is hidden  (n,) bool.
    """
    x, y, z = eye.tolist()
    targets = [(a, b, c) for a, b, c in points.tolist()]
    found = np.zeros(len(points), bool)
    for frame in map(_frame, gates):
        here = frame.gate.to_local((x, y, z))
        found |= [_stops(frame.touch(here, frame.gate.to_local(target))) for target in targets]
    for obstacle in obstacles:
        swept = SweptObstacle(obstacle, 0, 0.0)
        found |= [_stops(swept.touch((x, y, z), target)) for target in targets]
    return found


def _stops(touched: float | None) -> bool:
    """Return whether a contact at this fraction of a line of sight hides its end."""
    return touched is not None and touched < BEFORE


def hidden_corners(
    gates: Sequence[Gate], eye: np.ndarray, obstacles: Sequence[Obstacle] = ()
) -> np.ndarray:
    """Return which corners of openings are hidden by another gate's frame or an obstacle.

    A gate's own frame is ignored: a corner lies half a frame's depth, 5 cm, behind the visible
    edge.

    Args:
        gates: the distinct gates.
        eye: position of the camera in the world [m]  (3,).
        obstacles: obstacles, which may hide points.

    Returns:
        Mask in the order of `Gate.corners`  (gates, 4) bool.
    """
    rows = [
        hidden(gate.corners(), eye, [g for g in gates if g != gate], obstacles) for gate in gates
    ]
    return np.array(rows).reshape(-1, 4)
