"""The rows of numbers that samples of the racing cost fly to: a gate's exit, its free opening, the way that is left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers.costs.frames import SAFETY_MARGIN, inner_margin
from controllers.costs.ways_round import stops_between
from quadsim.course import FRAME_DEPTH, Course, EstimatedGate, Gate, in_frame

TO_GO, DEPTH = 12, 19  # columns of the target rows


class GateTarget(NamedTuple):
    """A target row of the racing cost: a gate's exit and its free opening, the leg to it, the way that is left."""

    x: float  # exit [m]
    y: float
    z: float
    nx: float  # passage
    ny: float
    nz: float
    lx: float  # left axis
    ly: float
    lz: float
    free_y: float  # half the free opening [m]
    free_z: float
    bar: float  # thickness of the bars around it [m]
    to_go: float  # distance to go from the exit on [m]
    approach: float  # length of the approach [m]
    ex: float  # direction of the leg to the exit
    ey: float
    ez: float
    leg: float  # its length [m]
    margin: float  # wanted [m]
    depth: float  # from entry to exit [m]


GATE_STDS = 2.5  # standard deviations of a gate's estimated position that are added to the margin
MARGIN_LIMIT = 0.7  # share of half the free opening that margin and uncertainty take at most
RUN_OUT = 100.0  # [m] from the last gate to a last target behind it, so that plans do not end at the finish


def cross(a, b):
    """The cross product of two vectors of three numbers.  (3,)"""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def targets(
    course: Course, radius: float, margin: tuple[float, float], box: Sequence[float], laps: int
) -> tuple[np.ndarray, list[int]]:
    """Target rows: one for each gate of every lap, at its exit, before it one for each point of the way round obstacles
    to it, and one behind the finish (rows, 20); where the rows of each gate, and of the finish, begin.

    Exit, passage, left axis, half the free opening, thickness of the bars around it, distance to go from there, length
    of the approach, direction and length of the leg to the exit, margin wanted, from entry to exit. margin: [m], and
    the share of half the free opening that it takes at most.
    """
    gates = (*course.gates * laps, course.gates[-1])
    passage, left = (np.array([g.rotation[:, k] for g in gates]) for k in (0, 1))
    opening = np.array([g.opening for g in gates])
    behind = np.array([exit_distance(g, radius, box) for g in gates[:-1]] + [RUN_OUT])
    exits = np.array([g.position for g in gates]) + behind[:, None] * passage
    inner = inner_margin(opening, radius)
    free = opening / 2 - radius - inner[:, None]
    wanted = np.minimum(margin[0], margin[1] * free.min(axis=1))  # a narrow gate leaves less
    uncertain = GATE_STDS * np.array([g.std if isinstance(g, EstimatedGate) else 0.0 for g in gates])
    wanted = np.maximum(wanted, np.minimum(wanted + uncertain, MARGIN_LIMIT * free.min(axis=1)))
    free[-1] = RUN_OUT  # no frame stands there
    bar = np.array([g.frame_width for g in gates]) + 2 * radius + SAFETY_MARGIN + inner
    depth = behind + clear_of_frame(radius)
    stops = np.column_stack([exits, passage, left, free, bar, opening.max(axis=1), wanted, depth])
    between = stops_between(course, stops, radius + 2 * SAFETY_MARGIN, box)
    if between:
        stops = np.vstack([row for k, stop in enumerate(stops) for row in (*between.get(k, ()), stop)])
    exits, passage, left, free, last = np.split(stops, (3, 6, 9, 11), axis=1)
    bar, approach, wanted, depth = last.T
    legs = np.diff([course.start.position, *exits], axis=0)
    lengths = np.maximum(np.linalg.norm(legs, axis=1), 1e-6)
    # the way from gate to gate as terms() measures it, round a gate that faces away: no jump of the cost at a gate
    faces_away = (legs * passage).sum(axis=1) < 1e-6
    ways_round = np.linalg.norm(approach[:, None] * passage - legs, axis=1) + approach
    ways = np.where(faces_away, ways_round, lengths)
    to_go = np.append(np.cumsum(ways[:0:-1])[::-1], 0.0)
    along = legs / lengths[:, None]
    rows = np.column_stack([exits, passage, left, free, bar, to_go, approach, along, lengths, wanted, depth])
    counts = [1 + len(between.get(k, ())) for k in range(len(gates))]
    return rows, np.cumsum([0, *counts]).tolist()


def clear_of_frame(radius: float) -> float:
    """From the gate's plane to the entry, and to the exit, where the vehicle is clear of the frame [m]."""
    return FRAME_DEPTH / 2 + radius + SAFETY_MARGIN


def exit_distance(gate: Gate, radius: float, box: Sequence[float]) -> float:
    """From the gate's plane to its exit: where the box ends sooner, half of the way there [m]."""
    floor, x_low, x_high, y_low, y_high, z_high = box
    room = [clear_of_frame(radius)]
    sides = ((x_low, x_high), (y_low, y_high), (floor, z_high))
    for centre, way, (low, high) in zip(gate.position, gate.axes[0], sides, strict=True):
        if abs(way) > 1e-9:
            room.append(((high if way > 0.0 else low) - centre) / way / 2)
    return max(min(room), 1e-3)


def is_inside(clear: float, x: np.ndarray, row: np.ndarray) -> bool:
    """Whether x is past the gate's plane, within its outline, but not yet at its exit; clear: see clear_of_frame."""
    passage, left = row[3:6], row[6:9]
    s, y, z = in_frame(x[:3] - row[:3], passage, left, cross(passage, left))
    free_y, free_z, bar = row[9:12]
    return bool(clear - row[DEPTH] <= s < 0.0 and max(abs(y) - free_y, abs(z) - free_z) < bar)
