"""Ways around frames and boxes that a solution hits beside its targets: half-spaces for a few of its nodes.

The space around a frame or a box is not convex. So a race is solved without them first; where the referee then finds a
hit, the nodes in the frame's slab are held before, behind or beside it, those in a box beyond one of its faces,
whichever is the shortest way out, and it is solved again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from quadsim.course import Box, Gate
from quadsim.course.swept import SweptGate
from quadsim.limit.solution import Solution
from quadsim.limit.task import MARGIN, Segment, Task
from quadsim.systems.quadrotor import POSITION


@dataclass(frozen=True)
class Detour:
    """sign * local[axis] >= distance, in the frame of a gate or a box, for the nodes in a part of a segment."""

    segment: int
    part: tuple[float, float]  # of the segment's intervals, 0 to 1
    gate: Gate | Box
    axis: int
    sign: float
    distance: float  # [m]

    def holds_at(self, segment: int, node: int, intervals: int) -> bool:
        """For the nodes in that part; beyond an edge one more on either side, as the line between two stays out too."""
        first, last = (share * intervals for share in self.part)
        more = 1.0 if self.axis else 0.0
        return segment == self.segment and first - more <= node <= last + more

    def spare(self, local: Any) -> Any:
        """At or above 0 where it is kept [m].  local: in the gate's frame"""
        return self.sign * local[self.axis] - self.distance


def detours(
    solution: Solution, plan: list[Segment], task: Task, hits: list[tuple[float, Gate | Box]]
) -> Iterator[Detour]:
    """Around what was hit.  hits: time [s], and gate or box, of each."""
    begins = np.cumsum([0, *(s.intervals for s in plan)])  # index of the node where each segment begins
    for t, gate in hits:
        k = int(np.searchsorted(begins, np.searchsorted(solution.t, t))) - 1
        if plan[k].kind == "approach":
            own = slice(begins[k], begins[k + 1])
            local = (solution.x[own, POSITION] - gate.position) @ np.array(gate.axes).T  # (nodes of the segment, 3)
            hit = min(int(np.searchsorted(solution.t[own], t)), len(local) - 1)
            if isinstance(gate, Box):
                reach = [half + task.radius for half in gate.half]
                ways = _ways_out_of_a_box(local, hit, reach)
            else:
                swept = SweptGate(gate, 0, task.radius)
                reach, ways = swept.slab, _ways_out(local, hit, swept)
            for first, last, axis, sign in ways:
                part = (first - 0.5) / plan[k].intervals, (last + 0.5) / plan[k].intervals
                yield Detour(k, part, gate, axis, sign, reach[axis] + MARGIN)


def _ways_out(local: np.ndarray, hit: int, swept: SweptGate) -> Iterator[tuple[int, int, int, float]]:
    """First and last node of each run, with the axis and the sign of the side that is nearest to its nodes.

    Those are the slab's two faces and one edge of the frame, the nearest to all nodes in the slab.
    """
    first, last = _within(abs(local[:, 0]) <= swept.slab[0], hit)
    edges = [(axis, sign) for axis in (1, 2) for sign in (1.0, -1.0)]
    edge = min(edges, key=lambda e: swept.slab[e[0]] - (e[1] * local[first : last + 1, e[0]]).min())
    sides = [(0, 1.0), (0, -1.0), edge]
    nodes = range(max(first - 1, 1), min(last + 2, len(local)))
    nearest = [min(sides, key=lambda s: swept.slab[s[0]] - s[1] * local[n, s[0]]) for n in nodes]
    for i in range(len(nearest) - 1):
        if nearest[i][0] == nearest[i + 1][0] == 0 and nearest[i] != nearest[i + 1]:
            nearest[i : i + 2] = [edge] * 2  # from one face to the other leads past the edge
    for side, run in groupby(zip(nearest, nodes, strict=True), key=lambda pair: pair[0]):
        found = [node for _, node in run]
        yield found[0], found[-1], *side


def _ways_out_of_a_box(local: np.ndarray, hit: int, half: Sequence[float]) -> Iterator[tuple[int, int, int, float]]:
    """As `_ways_out`: one face for all nodes in the box, the one that is nearest to the deepest of them."""
    first, last = _within(np.all(abs(local) <= half, axis=1), hit)
    faces = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]
    axis, sign = min(faces, key=lambda f: half[f[0]] - (f[1] * local[first : last + 1, f[0]]).min())
    yield max(first - 1, 1), min(last + 1, len(local) - 1), axis, sign


def _within(inside: np.ndarray, node: int) -> tuple[int, int]:
    """First and last of the neighbouring nodes around this one that are inside; itself where none is."""
    first = last = node
    while first > 0 and inside[first - 1]:
        first -= 1
    while last + 1 < len(inside) and inside[last + 1]:
        last += 1
    return first, last
