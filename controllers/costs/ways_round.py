"""Ways round obstacles between two gates: points to fly by where the straight line is blocked.

A way is the shortest path in the graph of lines that see each other (a visibility graph), between
corners around the obstacles, at the heights of the two ends and above the obstacles' tops. It is a
guide: samples keep clear of obstacles by themselves, and find their way round a pole without help,
but they do not see the end of a wall that is longer than the distance they reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from controllers.costs.frames import ObstacleRow, obstacle_rows, touches_round
from controllers.costs.room import Room
from quadsim.course import Box, Course, Cylinder, Obstacle
from quadsim.course.opening import HalfSizes
from quadsim.course.swept import clip, lerp
from quadsim.rotation import Vec3

# Length by which a way round exceeds the straight line at least [m]; samples find a shorter one by
# themselves
WORTH = 0.1
OUTSIDE = 0.02  # distance of the points beyond the clearance of the lines [m]
ANYWHERE = 50.0  # half the opening of a point on the way, which has no frame [m]
EIGHTHS = 1.0 / np.cos(np.pi / 8.0)  # an octagon's corners over the circle inside it


class Stop(NamedTuple):
    """A plane that the vehicle has to cross within an opening.

    It is the exit plane of a gate, or a plane through a point on the way round obstacles.
    """

    exit: np.ndarray  # middle of the opening, at the exit plane [m]  (3,)
    passage: np.ndarray  # unit vector along the passage  (3,)
    left: np.ndarray  # unit vector to the left  (3,)
    free: HalfSizes  # half sizes of the free opening [m]
    bar: float  # thickness of the bars around it [m]
    approach: float  # from the plane to the point in front of it where the approach begins [m]
    margin: float  # wanted between vehicle and frame [m]
    depth: float  # from entry to exit plane [m]


def way_round(
    start: Vec3, end: Vec3, obstacles: Sequence[Obstacle], clear: float, room: Room
) -> np.ndarray:
    """Return the points between the ends of the shortest way round obstacles, in order.

    There are none where the straight line is free, where the way round is little longer, or where
    no way is found.

    Args:
        start: the point where the way begins [m].
        end: the point where it ends [m].
        obstacles: the obstacles to fly round.
        clear: distance kept from the vehicle's centre to an obstacle [m].
        room: the room in which the vehicle may fly.

    Returns:
        (points, 3)
    """
    none = np.empty((0, 3))
    if not obstacles:
        return none
    rows = obstacle_rows(obstacles, clear)
    straight = np.linalg.norm(np.subtract(end, start))
    if sees(np.array([start]), np.array([end]), rows)[0]:
        return none

    # The ends, and the corners around the obstacles where the vehicle may fly
    corners = np.vstack([_corners(each, clear + OUTSIDE, start, end) for each in obstacles])
    low = np.array([room.x_low, room.y_low, room.floor])
    high = np.array([room.x_high, room.y_high, room.z_high])
    in_room = ((low <= corners) & (corners <= high)).all(axis=1)
    points = np.vstack([start, end, corners[in_room]])

    # The lengths of the lines between any two points that see each other
    a, b = np.triu_indices(len(points), 1)
    apart = np.linalg.norm(points[a] - points[b], axis=1)
    lengths = np.full((len(points), len(points)), np.inf)
    lengths[a, b] = np.where(sees(points[a], points[b], rows), apart, np.inf)
    path, length = shortest(np.minimum(lengths, lengths.T))
    if not straight + WORTH < length < np.inf:
        return none
    return points[path[1:-1]]


def sees(a: np.ndarray, b: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return whether lines are clear of obstacles.

    Args:
        a: beginnings of the lines [m]  (n, 3).
        b: ends of the lines [m]  (n, 3).
        rows: obstacles, rows of `ObstacleRow`.

    Returns:
        (n,)
    """
    clear = np.ones(len(a), bool)
    for row in rows:
        clear &= ~touches_round(tuple(a.T), tuple(b.T), ObstacleRow(*row.tolist()))
    return clear


def shortest(lengths: np.ndarray) -> tuple[list[int], float]:
    """Return the shortest path from node 0 to node 1.

    Args:
        lengths: lengths of the lines between any two nodes, inf if there is no line  (n, n).

    Returns:
        The nodes of the path and its length, inf if there is no path.
    """
    # Imported here, as commands that plan nothing need not wait for it
    from scipy.sparse.csgraph import csgraph_from_dense, dijkstra

    graph = csgraph_from_dense(lengths, null_value=np.inf)
    far, before = dijkstra(graph, indices=0, return_predecessors=True)
    path = [1]
    while path[-1] and far[1] < np.inf:
        path.append(int(before[path[-1]]))
    return path[::-1], float(far[1])


def _corners(obstacle: Obstacle, clear: float, start: Vec3, end: Vec3) -> np.ndarray:
    """Return points around an obstacle to fly by.

    They lie at the heights of both ends, and above the obstacle's top where the straight line
    enters and leaves its outline.

    Args:
        obstacle: the obstacle.
        clear: distance of the points from its sides and its top [m].
        start: the point where the way begins [m].
        end: the point where it ends [m].

    Returns:
        (points, 3)
    """
    if isinstance(obstacle, Cylinder):
        r = obstacle.radius
        around = obstacle.outline(EIGHTHS * (r + clear) - r)[::3]
        box = Box(obstacle.centre, (2 * r, 2 * r, obstacle.height))
    else:
        around = obstacle.outline(clear)
        box = obstacle
    points = [(*xy, z) for xy, z in product(around.tolist(), {start[2], end[2]})]

    # The part of the straight line within the outline, as fractions of the line
    x, y, z = box.half[0] + clear, box.half[1] + clear, np.inf
    crossed = clip(box.to_local(start), box.to_local(end), (-x, -y, -z), (x, y, z))
    for fraction in crossed or ():
        above_x, above_y, _ = lerp(start, end, fraction)
        points.append((above_x, above_y, obstacle.top + clear))
    return np.array(points)


def stops_between(
    course: Course, stops: Sequence[Stop], clear: float, room: Room
) -> dict[int, list[Stop]]:
    """Return the stops on the ways round obstacles, for each gate that has some.

    A gate that faces away is reached by the point in front of it.

    Args:
        course: its obstacles, and the place where flights start.
        stops: stops at the gates of every lap, and the one behind the finish.
        clear: distance kept from the vehicle's centre to an obstacle [m].
        room: the room in which the vehicle may fly.

    Returns:
        The stops by the gate's index in `stops`.
    """
    if not course.obstacles:
        return {}
    found: dict[int, list[Stop]] = {}
    # Ways round by their ends, as those of every lap are alike
    known: dict[tuple[Vec3, Vec3], np.ndarray] = {}
    at_gates = stops[:-1]
    before = [course.start.position, *(_as_tuple(stop.exit) for stop in at_gates[:-1])]
    for k, (start, stop) in enumerate(zip(before, at_gates, strict=True)):
        faces_away = (stop.exit - start) @ stop.passage < 1e-6
        end = stop.exit - stop.approach * stop.passage if faces_away else stop.exit
        ends = start, _as_tuple(end)
        if ends not in known:
            known[ends] = way_round(*ends, course.obstacles, clear=clear, room=room)
        if len(known[ends]):
            path = np.vstack([start, known[ends], end])
            found[k] = [_by_the_way(*path[i : i + 3]) for i in range(len(path) - 2)]
    return found


def _as_tuple(point: np.ndarray) -> Vec3:
    """Return a point as a tuple, which may be a key."""
    x, y, z = point.tolist()
    return x, y, z


def _by_the_way(before: np.ndarray, here: np.ndarray, after: np.ndarray) -> Stop:
    """Return the stop at a point on the way, reached wherever its plane is crossed.

    The plane halves the angle of the path at this point.

    Args:
        before: the point before on the path [m]  (3,).
        here: the point [m]  (3,).
        after: the point after it [m]  (3,).
    """
    arriving = _direction(before, here)
    leaving = _direction(here, after)
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


def _direction(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the unit vector from a to b.  (3,)"""
    return (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
