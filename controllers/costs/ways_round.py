"""Ways round obstacles that stand between two gates: points to fly by, where the straight line is
blocked.

The shortest path in the graph of lines that see each other (a visibility graph), between corners
around the obstacles at the heights of the two ends and above their tops. It is a guide: samples
keep clear of obstacles by themselves, and go round a pole without help, but see no end of a wall
that is longer than what they reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from controllers.costs.frames import ObstacleRow, obstacle_rows, touches_round
from quadsim.course import Box, Course, Cylinder, Obstacle
from quadsim.course.opening import HalfSizes
from quadsim.course.swept import clip, lerp
from quadsim.rotation import Vec3

# [m] by which a way round is longer than the straight line; samples find a shorter one by
# themselves
WORTH = 0.1
OUTSIDE = 0.02  # [m] of the points beyond what the lines keep clear of
ANYWHERE = 50.0  # half the opening of a point on the way, which has no frame [m]
EIGHTHS = 1.0 / np.cos(np.pi / 8.0)  # an octagon's corners over the circle inside it


class Stop(NamedTuple):
    """A plane that the vehicle has to cross within an opening: that of a gate's exit, or one on the
    way round."""

    exit: np.ndarray  # middle of the opening, at the exit plane [m]  (3,)
    passage: np.ndarray  # unit vector along the passage  (3,)
    left: np.ndarray  # unit vector to the left  (3,)
    free: HalfSizes  # of the free opening [m]
    bar: float  # thickness of the bars around it [m]
    approach: float  # from the plane to the point in front of it where the approach begins [m]
    margin: float  # wanted between vehicle and frame [m]
    depth: float  # from entry to exit plane [m]


def way_round(
    start: Vec3, end: Vec3, obstacles: Sequence[Obstacle], clear: float, room: Sequence[float]
) -> np.ndarray:
    """Return the points between the ends of the shortest way round obstacles, in order.  (n, 3)

    There are none where the straight line is free, where the way round is little longer, or where
    no way is found.

    Args:
        start: where the way begins [m].
        end: where it ends [m].
        obstacles: to fly round.
        clear: from the vehicle's centre to an obstacle [m].
        room: where the vehicle may fly, of `room_to_fly` [m].
    """
    none = np.empty((0, 3))
    if not obstacles:
        return none
    rows = obstacle_rows(obstacles, clear)
    straight = np.linalg.norm(np.subtract(end, start))
    if sees(np.array([start]), np.array([end]), rows)[0]:
        return none

    # Corners around the obstacles, those where the vehicle may fly
    corners = np.vstack([_corners(o, clear + OUTSIDE, start, end) for o in obstacles])
    floor, x_low, x_high, y_low, y_high, z_high = room
    low, high = np.array([x_low, y_low, floor]), np.array([x_high, y_high, z_high])
    points = np.vstack([start, end, corners[((low <= corners) & (corners <= high)).all(axis=1)]])

    # Lengths of the lines between any two points that see each other
    a, b = np.triu_indices(len(points), 1)
    lengths = np.full((len(points), len(points)), np.inf)
    lengths[a, b] = np.where(
        sees(points[a], points[b], rows), np.linalg.norm(points[a] - points[b], axis=1), np.inf
    )
    path, length = shortest(np.minimum(lengths, lengths.T))
    return points[path[1:-1]] if straight + WORTH < length < np.inf else none


def sees(a: np.ndarray, b: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return whether lines are clear of obstacles.  (n,)

    Args:
        a: where the lines begin [m].  (n, 3)
        b: where they end [m].  (n, 3)
        rows: of `ObstacleRow`.
    """
    clear = np.ones(len(a), bool)
    for row in rows:
        clear &= ~touches_round(tuple(a.T), tuple(b.T), ObstacleRow(*row.tolist()))
    return clear


def shortest(lengths: np.ndarray) -> tuple[list[int], float]:
    """From node 0 to node 1, by the lengths between each two: the nodes, and their length (Dijkstra
    1959)."""
    n = len(lengths)
    far, before, done = np.full(n, np.inf), np.zeros(n, int), np.zeros(n, bool)
    far[0] = 0.0
    for _ in range(n):
        k = int(np.argmin(np.where(done, np.inf, far)))
        done[k] = True
        shorter = far[k] + lengths[k] < far
        far[shorter], before[shorter] = far[k] + lengths[k][shorter], k
    path = [1]
    while path[-1] and far[1] < np.inf:
        path.append(int(before[path[-1]]))
    return path[::-1], float(far[1])


def _corners(obstacle: Obstacle, clear: float, start: Vec3, end: Vec3) -> np.ndarray:
    """Around it, this far from its sides, at the heights of both ends, and as far above its top
    where the straight line comes and goes.  (n, 3)"""
    if isinstance(obstacle, Cylinder):
        r = obstacle.radius
        around = obstacle.outline(EIGHTHS * (r + clear) - r)[::3]
        box = Box(obstacle.centre, (2 * r, 2 * r, obstacle.height))
    else:
        around, box = obstacle.outline(clear), obstacle
    points = [(*xy, z) for xy, z in product(around.tolist(), {start[2], end[2]})]
    x, y, z = box.half[0] + clear, box.half[1] + clear, np.inf
    crossed = clip(box.to_local(start), box.to_local(end), (-x, -y, -z), (x, y, z))
    points += [(*lerp(start, end, s)[:2], obstacle.top + clear) for s in crossed or ()]
    return np.array(points)


def stops_between(
    course: Course, stops: Sequence[Stop], clear: float, room: Sequence[float]
) -> dict[int, list[Stop]]:
    """Return the stops at the points of ways round, for each gate that has one, by the gate's index
    in `stops`.

    A gate that faces away is reached by the point in front of it.

    Args:
        course: its obstacles, and where flights start.
        stops: those at the gates of every lap, and the one behind the finish.
        clear: from the vehicle's centre to an obstacle [m].
        room: where the vehicle may fly, of `room_to_fly` [m].
    """
    if not course.obstacles:
        return {}
    found: dict[int, list[Stop]] = {}
    # ways round by their ends: those of every lap are alike
    known: dict[tuple[Vec3, Vec3], np.ndarray] = {}
    at_gates = stops[:-1]
    before = [course.start.position, *(_as_tuple(stop.exit) for stop in at_gates[:-1])]
    for k, (start, stop) in enumerate(zip(before, at_gates, strict=True)):
        faces_away = (stop.exit - start) @ stop.passage < 1e-6
        end = stop.exit - stop.approach * stop.passage if faces_away else stop.exit
        ends = start, _as_tuple(end)
        if ends not in known:
            known[ends] = way_round(*ends, course.obstacles, clear, room)
        if len(known[ends]):
            path = np.vstack([start, known[ends], end])
            found[k] = [_by_the_way(*path[i : i + 3]) for i in range(len(path) - 2)]
    return found


def _as_tuple(point: np.ndarray) -> Vec3:
    x, y, z = point.tolist()
    return x, y, z


def _by_the_way(before: np.ndarray, here: np.ndarray, after: np.ndarray) -> Stop:
    """Return a stop that is reached where its plane is crossed, wherever that is.

    The plane halves the angle of the path from the point before (3,), past this one (3,), to the
    one after (3,).
    """
    arriving, leaving = (
        d / max(float(np.linalg.norm(d)), 1e-9) for d in (here - before, after - here)
    )
    both = arriving + leaving
    passage = both if np.linalg.norm(both) > 1e-6 else leaving
    passage = passage / np.linalg.norm(passage)
    upright = abs(passage[2]) >= 0.999
    left = np.array([0.0, 1.0, 0.0]) if upright else np.array([-passage[1], passage[0], 0.0])
    return Stop(
        exit=here,
        passage=passage,
        left=left / np.linalg.norm(left),
        free=HalfSizes(ANYWHERE, ANYWHERE),
        bar=0.1,
        approach=0.1,
        margin=0.0,
        depth=1e-3,
    )
