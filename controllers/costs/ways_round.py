"""Ways round obstacles between two gates: waypoints if the straight line is blocked.

A way is the shortest path in a visibility graph, between corners around the obstacles at the
heights of the two ends and above the obstacles' tops. It is only a guide: samples avoid obstacles
by themselves and find a way round a pole without help, but their horizon does not reach the end of
a long wall.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from quadsim.controllers.costs.frames import ObstacleRow, obstacle_rows, touches_round
from quadsim.controllers.costs.room import Room
from quadsim.course import Box, Course, Cylinder, Obstacle
from quadsim.course.opening import HalfSizes
from quadsim.course.swept import clip, lerp
from quadsim.rotation import Vec3

# Smallest length by which a way round exceeds the straight line [m]; samples find shorter ones by
# themselves
WORTH = 0.1
OUTSIDE = 0.02  # distance of the points beyond the clearance of the lines [m]
ANYWHERE = 50.0  # half the opening of a waypoint, which has no frame [m]
EIGHTHS = 1.0 / np.cos(np.pi / 8.0)  # ratio of an octagon's circumradius to its inradius


class Stop(NamedTuple):
    """A plane that the vehicle has to cross within an opening.

    The plane is the exit plane of a gate, or a plane through a waypoint on a way round obstacles.
    """

    exit: np.ndarray  # middle of the opening, at the exit plane [m]  (3,)
    passage: np.ndarray  # unit vector along the passage  (3,)
    left: np.ndarray  # unit vector to the left  (3,)
    free: HalfSizes  # half sizes of the free opening [m]
    bar: float  # thickness of the surrounding bars [m]
    approach: float  # distance in front of the plane at which the approach begins [m]
    margin: float  # desired distance between vehicle and frame [m]
    depth: float  # from entry to exit plane [m]


def way_round(
    start: Vec3, end: Vec3, obstacles: Sequence[Obstacle], clear: float, room: Room
) -> np.ndarray:
    """Return the waypoints of the shortest way round obstacles, in order.

    There are none if the straight line is free, if the way round is only slightly longer, or if no
    way is found.

    Args:
        start: beginning of the way [m].
        end: end of the way [m].
        obstacles: the obstacles to avoid.
        clear: clearance between the vehicle's centre and an obstacle [m].
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

    # The ends, and the corners around the obstacles within the room
    corners = np.vstack([_corners(each, clear + OUTSIDE, start, end) for each in obstacles])
    low = np.array([room.x_low, room.y_low, room.floor])
    high = np.array([room.x_high, room.y_high, room.z_high])
    in_room = ((low <= corners) & (corners <= high)).all(axis=1)
    points = np.vstack([start, end, corners[in_room]])

    # The lengths of the free lines between any two points
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
    """Return candidate waypoints around an obstacle.

    They lie at the heights of both ends, and above the obstacle's top where the straight line
    enters and leaves its outline.

    Args:
        obstacle: the obstacle.
        clear: distance of the points from the obstacle's sides and top [m].
        start: beginning of the way [m].
        end: end of the way [m].

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
    """Return the stops on the ways round obstacles, for each gate with such a way.

    A gate that faces away is reached through the point in front of it.

    Args:
        course: the course with obstacles and start.
        stops: stops at the gates of every lap, and the stop behind the finish.
        clear: clearance between the vehicle's centre and an obstacle [m].
        room: the room in which the vehicle may fly.

    Returns:
        The stops by the gate's index in `stops`.
    """
    if not course.obstacles:
        return {}
    found: dict[int, list[Stop]] = {}
    # Ways round by their ends, as all laps have the same ways
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
    """Return a point as a tuple, for use as a key."""
    x, y, z = point.tolist()
    return x, y, z


def _by_the_way(before: np.ndarray, here: np.ndarray, after: np.ndarray) -> Stop:
    """Return the stop at a waypoint, which is reached by any crossing of its plane.

    The plane halves the angle of the path at this point.

    Args:
        before: the previous point of the path [m]  (3,).
        here: the waypoint [m]  (3,).
        after: the next point of the path [m]  (3,).
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
