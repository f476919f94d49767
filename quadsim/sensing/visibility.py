"""Which points a frame or an obstacle hides from the camera: lines of sight, as paths of a sphere
of radius 0."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np

from quadsim.course import Gate
from quadsim.course.obstacles import Obstacle
from quadsim.course.swept import SweptGate
from quadsim.course.swept_obstacles import SweptObstacle

# share of a line of sight: a frame that begins in the point itself does not hide it
BEFORE = 1.0 - 1e-6


@lru_cache(1024)  # the same few gates in every picture
def _frame(gate: Gate) -> SweptGate:
    return SweptGate(gate, 0, 0.0)


def hidden(
    points: np.ndarray, eye: np.ndarray, gates: Iterable[Gate], obstacles: Iterable[Obstacle] = ()
) -> np.ndarray:
    """Which points (n, 3) a bar of any of these gates, or any of these obstacles, hides from an eye
    at (3,).

    All in the world frame [m].  (n,) bool
    """
    x, y, z = eye.tolist()
    found = np.zeros(len(points), bool)
    for frame in map(_frame, gates):
        here = frame.gate.to_local((x, y, z))
        touches = (frame.touch(here, frame.gate.to_local((a, b, c))) for a, b, c in points.tolist())
        found |= [s is not None and s < BEFORE for s in touches]
    for thing in (SweptObstacle(obstacle, 0, 0.0) for obstacle in obstacles):
        touches = (thing.touch((x, y, z), (a, b, c)) for a, b, c in points.tolist())
        found |= [s is not None and s < BEFORE for s in touches]
    return found


def hidden_corners(
    gates: Sequence[Gate], eye: np.ndarray, obstacles: Sequence[Obstacle] = ()
) -> np.ndarray:
    """Which corners of the gates' openings another gate's frame or an obstacle hides, in the order
    of `Gate.corners`.

    Its own frame hides none: a corner lies half a frame's depth behind the edge that is seen, 5 cm.
     (n, 4) bool
    """
    rows = [
        hidden(gate.corners(), eye, [g for g in gates if g != gate], obstacles) for gate in gates
    ]
    return np.array(rows).reshape(-1, 4)
