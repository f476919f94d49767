"""Ways round obstacles that stand between two gates: points to fly by, where the straight line is blocked.

The shortest path in the graph of lines that see each other (a visibility graph), between corners around the obstacles
at the heights of the two ends and above their tops. It is a guide: samples keep clear of obstacles by themselves, and
go round a pole without help, but see no end of a wall that is longer than what they reach.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from controllers.costs.frames import ObstacleRow, obstacle_rows, touches_round
from quadsim.course import Box, Course, Cylinder, Obstacle, Vec3
from quadsim.course.swept import clip, lerp

WORTH = 0.1  # [m] by which a way round is longer than the straight line; samples find a shorter one by themselves
OUTSIDE = 0.02  # [m] of the points beyond what the lines keep clear of
ANYWHERE = 50.0  # half the opening of a point on the way, which has no frame [m]
EIGHTHS = 1.0 / np.cos(np.pi / 8.0)  # an octagon's corners over the circle inside it


def way_round(start: Vec3, end: Vec3, obstacles: Sequence[Obstacle], clear: float, box: Sequence[float]) -> np.ndarray:
    """Points between the ends, in order; none where the line is free, little longer round, or no way is found.  (n, 3)

    clear: from the vehicle's centre to an obstacle; box: where it may fly, of `room_to_fly` [m].
    """
    none = np.empty((0, 3))
    if not obstacles:
        return none
    rows = obstacle_rows(obstacles, clear)
    straight = np.linalg.norm(np.subtract(end, start))
    if sees(np.array([start]), np.array([end]), rows)[0]:
        return none
    corners = np.vstack([_corners(o, clear + OUTSIDE, start, end) for o in obstacles])
    low, high = np.array([box[1], box[3], box[0]]), np.array([box[2], box[4], box[5]])
    points = np.vstack([start, end, corners[((low <= corners) & (corners <= high)).all(axis=1)]])
    a, b = np.triu_indices(len(points), 1)
    lengths = np.full((len(points), len(points)), np.inf)
    lengths[a, b] = np.where(sees(points[a], points[b], rows), np.linalg.norm(points[a] - points[b], axis=1), np.inf)
    path, length = shortest(np.minimum(lengths, lengths.T))
    return points[path[1:-1]] if straight + WORTH < length < np.inf else none


def sees(a: np.ndarray, b: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Whether the lines from a (n, 3) to b (n, 3) are clear of the obstacles of these rows.  (n,)"""
    clear = np.ones(len(a), bool)
    for row in rows:
        clear &= ~touches_round(tuple(a.T), tuple(b.T), ObstacleRow(*row.tolist()))
    return clear


def shortest(lengths: np.ndarray) -> tuple[list[int], float]:
    """From node 0 to node 1, by the lengths between each two: the nodes, and their length (Dijkstra 1959)."""
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
    """Around it, this far from its sides, at the heights of both ends, and as far above its top where the straight
    line comes and goes.  (n, 3)"""
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


def stops_between(course: Course, stops: np.ndarray, clear: float, box: Sequence[float]) -> dict[int, list[np.ndarray]]:
    """Rows like those of `stops` (gates, 15), of controllers.costs.race_targets: for each gate with a way round, those
    of its points. A gate that faces away is reached by the point in front of it."""
    found: dict[int, list[np.ndarray]] = {}
    known: dict[tuple, np.ndarray] = {}
    before = [course.start.position, *map(tuple, stops[:-2, :3].tolist())]
    for k, (a, stop) in enumerate(zip(before, stops[:-1], strict=True)) if course.obstacles else ():
        end, passage = stop[:3], stop[3:6]
        if (end - a) @ passage < 1e-6:
            end = end - stop[12] * passage
        ends = a, tuple(end.tolist())
        if ends not in known:
            known[ends] = way_round(*ends, course.obstacles, clear, box)
        if len(known[ends]):
            path = np.vstack([a, known[ends], end])
            found[k] = [_by_the_way(*path[i : i + 3]) for i in range(len(path) - 2)]
    return found


def _by_the_way(before: np.ndarray, here: np.ndarray, after: np.ndarray) -> np.ndarray:
    """A stop that is reached where its plane is crossed, wherever that is; the plane halves the angle of the path."""
    e = [d / max(float(np.linalg.norm(d)), 1e-9) for d in (here - before, after - here)]
    passage = e[0] + e[1] if np.linalg.norm(e[0] + e[1]) > 1e-6 else e[1]
    passage = passage / np.linalg.norm(passage)
    left = np.array([-passage[1], passage[0], 0.0]) if abs(passage[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    return np.array([*here, *passage, *left / np.linalg.norm(left), ANYWHERE, ANYWHERE, 0.1, 0.1, 0.0, 1e-3])


def row_ahead(
    still_in_gate: Callable, first: Sequence[int], rows: np.ndarray, obstacles: np.ndarray, target: int, x: np.ndarray
) -> int:
    """The row to fly to on the way to a target, where rows stand between gates: the last that is in sight of x, or the
    first whose plane x has not crossed. first: where each target's rows begin; obstacles: rows for `sees`."""
    target = min(target, len(first) - 2)
    begin, at_gate = first[target], first[target + 1] - 1
    if target > 0 and still_in_gate(x, rows[begin - 1]):
        return begin - 1
    ahead = [r for r in range(begin, at_gate) if (x[:3] - rows[r, :3]) @ rows[r, 3:6] < 0.0]
    later = np.arange(at_gate, ahead[0] if ahead else at_gate, -1)
    in_sight = later[sees(np.repeat(x[None, :3], len(later), axis=0), rows[later, :3], obstacles)]
    return int(in_sight[0]) if len(in_sight) else ahead[0] if ahead else at_gate
