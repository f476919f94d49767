"""Target rows of the racing cost: the places that samples fly to, one row of numbers each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from quadsim.controllers.costs.frames import SAFETY_MARGIN, inner_margin
from quadsim.controllers.costs.room import Room
from quadsim.controllers.costs.ways_round import Stop, sees, stops_between
from quadsim.course import Course, EstimatedGate, Gate, in_frame
from quadsim.course.opening import (
    FRAME_DEPTH,
    HalfSizes,
    Offset,
    approach_length,
    beyond,
    free_half_sizes,
    half_depth,
)
from quadsim.dynamics.named_tuples import as_rows, columns

# Number of standard deviations of a gate's position that are added to the margin. With 2.5 of them
# two of 30 flights of split_s_swift on `gates` hit a frame; with 4 none, and the race is 0.3 %
# slower.
GATE_STDS = 4.0
MARGIN_LIMIT = 0.7  # largest share of half the free opening for margin and uncertainty
# Distance from the last gate to a further target behind it, so that plans continue there [m]
RUN_OUT = 100.0


class Margin(NamedTuple):
    """The desired distance between vehicle and frame within a gate."""

    wanted: float  # [m]
    share: float  # upper limit, as a share of half the free opening


class GateTarget(NamedTuple):
    """A target row describes a place that a sample flies to.

    The place is the exit of a gate, a point beside an obstacle, or a point behind the finish. The
    drawing in quadsim.controllers.costs.race shows the sizes. Positions and directions are in the
    world frame.
    """

    # Position of the exit: the middle of the opening, where the vehicle is clear of the frame
    # behind the gate [m]
    x: float
    y: float
    z: float

    # Unit vector along the passage
    nx: float
    ny: float
    nz: float

    # Unit vector to the left, across the passage
    lx: float
    ly: float
    lz: float

    free_y: float  # half width and half height of the free opening [m]
    free_z: float
    bar: float  # thickness of the surrounding bars, grown by radius and margins [m]
    to_go: float  # from this exit to the last one, along the rows between them [m]
    # distance to the point in front of the gate where a vehicle behind the gate turns back [m]
    approach: float

    # Unit vector and length of the leg, from the previous exit to this one [m]
    ex: float
    ey: float
    ez: float
    leg: float

    margin: float  # desired distance between vehicle and frame [m]
    depth: float  # from entry plane to exit plane [m]


def cross(a, b):
    """Return the cross product of two vectors of three numbers.  (3,)"""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def targets(
    course: Course, radius: float, margin: Margin, room: Room, laps: int
) -> tuple[np.ndarray, list[int]]:
    """Return the target rows of a race.

    There is one row for each gate of every lap, preceded by one row for each point of a way round
    obstacles, and one row behind the finish.

    Args:
        course: the course with start, gates and obstacles.
        radius: radius of the vehicle [m].
        margin: desired distance between vehicle and frame.
        room: the room in which the vehicle may fly.
        laps: number of laps.

    Returns:
        Rows of `GateTarget` (rows, 20), and the index at which the rows of each gate begin
        (gates of all laps + 2,), where the last two are the indices of the finish and of the end.
    """
    stops = []
    for gate in course.gates * laps:
        behind = exit_distance(gate, radius, room)
        stops.append(gate_stop(gate, radius, margin, behind))
    stops.append(finish_stop(course.gates[-1], radius, margin))

    # The stops on the way to each gate, and to the finish
    between = stops_between(course, stops, radius + 2 * SAFETY_MARGIN, room)
    on_the_way: list[Stop] = []
    first = [0]
    for k, stop in enumerate(stops):
        on_the_way += [*between.get(k, ()), stop]
        first.append(len(on_the_way))
    return target_rows(course, on_the_way), first


def gate_stop(gate: Gate, radius: float, margin: Margin, behind: float) -> Stop:
    """Return the stop at a gate's exit.

    Args:
        gate: the gate to fly through.
        radius: radius of the vehicle [m].
        margin: desired distance between vehicle and frame.
        behind: distance from the gate's plane to the exit [m].
    """
    passage, left = gate.rotation[:, 0], gate.rotation[:, 1]
    inner = inner_margin(gate, radius)
    free = free_half_sizes(gate.opening, radius, inner)

    # A narrow gate has less space than the margin. An uncertain gate position needs a larger one.
    wanted = min(margin.wanted, margin.share * min(free))
    uncertain = GATE_STDS * (gate.std if isinstance(gate, EstimatedGate) else 0.0)
    wanted = max(wanted, min(wanted + uncertain, MARGIN_LIMIT * min(free)))
    return Stop(
        exit=gate.position + behind * passage,
        passage=passage,
        left=left,
        free=free,
        bar=gate.frame_width + 2 * radius + SAFETY_MARGIN + inner,
        approach=approach_length(gate.opening),
        margin=wanted,
        depth=behind + clear_of_frame(radius, gate.frame_depth),
    )


def finish_stop(last: Gate, radius: float, margin: Margin) -> Stop:
    """Return the stop far behind the last gate, without a frame.

    Args:
        last: the last gate.
        radius: radius of the vehicle [m].
        margin: desired distance between vehicle and frame.
    """
    stop = gate_stop(last, radius, margin, RUN_OUT)
    return stop._replace(free=HalfSizes(RUN_OUT, RUN_OUT))


def target_rows(course: Course, stops: Sequence[Stop]) -> np.ndarray:
    """Return the target rows of stops, with the legs that lead to them from the start.

    Args:
        course: the course with the start.
        stops: stops in the order of the flight.

    Returns:
        Rows of `GateTarget`  (stops, 20)
    """
    exits = np.array([stop.exit for stop in stops])
    passages = np.array([stop.passage for stop in stops])
    approaches = np.array([stop.approach for stop in stops])
    legs = np.diff([course.start.position, *exits], axis=0)
    lengths = np.maximum(np.linalg.norm(legs, axis=1), 1e-6)
    directions = legs / lengths[:, None]

    # Distances between gates, measured as in the term `progress`, around a gate that faces away, so
    # that the cost is continuous at a gate
    faces_away = (legs * passages).sum(axis=1) < 1e-6
    ways_round = np.linalg.norm(approaches[:, None] * passages - legs, axis=1) + approaches
    ways = np.where(faces_away, ways_round, lengths)
    to_go = np.append(np.cumsum(ways[:0:-1])[::-1], 0.0)

    rows = [
        GateTarget(
            *stop.exit,
            *stop.passage,
            *stop.left,
            free_y=stop.free.left,
            free_z=stop.free.up,
            bar=stop.bar,
            to_go=to_go[k],
            approach=stop.approach,
            ex=directions[k, 0],
            ey=directions[k, 1],
            ez=directions[k, 2],
            leg=lengths[k],
            margin=stop.margin,
            depth=stop.depth,
        )
        for k, stop in enumerate(stops)
    ]
    return as_rows(rows, GateTarget)


def clear_of_frame(radius: float, depth: float = FRAME_DEPTH) -> float:
    """Return the distance from a gate's plane at which the vehicle is clear of its frame [m].

    Args:
        radius: radius of the vehicle [m].
        depth: depth of the frame along the passage [m].
    """
    return half_depth(radius, SAFETY_MARGIN, depth)


def exit_distance(gate: Gate, radius: float, room: Room) -> float:
    """Return the distance from a gate's plane to its exit [m].

    If the room ends before, the exit lies half-way to that end.

    Args:
        gate: the gate to fly through.
        radius: radius of the vehicle [m].
        room: the room in which the vehicle may fly.
    """
    sides = (
        (room.x_low, room.x_high),
        (room.y_low, room.y_high),
        (room.floor, room.z_high),
    )
    distances = [clear_of_frame(radius, gate.frame_depth)]
    for centre, way, (low, high) in zip(gate.position, gate.axes[0], sides, strict=True):
        if abs(way) > 1e-9:
            end = high if way > 0.0 else low
            distances.append((end - centre) / way / 2)
    return max(min(distances), 1e-3)


def is_inside(clear: float, x: np.ndarray, row: np.ndarray) -> bool:
    """Return whether x is past a gate's plane, within its outline, on the way to its exit.

    A vehicle that flies back is not on this way: the second gate of a ladder may be reached back
    through the first one.

    Args:
        clear: distance from the gate's plane to its entry plane, see `clear_of_frame` [m].
        x: state, position and velocity first [m, m/s].
        row: the gate's row of `GateTarget`.
    """
    target = GateTarget(*row[: len(GateTarget._fields)])
    passage = (target.nx, target.ny, target.nz)
    left = (target.lx, target.ly, target.lz)
    from_exit = x[0] - target.x, x[1] - target.y, x[2] - target.z
    along, y, z = in_frame(from_exit, passage, left, cross(passage, left))
    past_the_plane = clear - target.depth <= along < 0.0
    outside = beyond(Offset(y, z), HalfSizes(target.free_y, target.free_z))
    flies_on = x[3] * target.nx + x[4] * target.ny + x[5] * target.nz > 0.0
    return bool(past_the_plane and outside < target.bar and flies_on)


def row_ahead(
    still_in_gate: Callable,
    first: Sequence[int],
    rows: np.ndarray,
    obstacles: np.ndarray,
    target: int,
    x: np.ndarray,
) -> int:
    """Return the current row on the way to a target, if there are rows between gates.

    It is the last row with a free line of sight from x, or else the first row whose plane x has not
    crossed.

    Args:
        still_in_gate: (x, row) -> whether x has not left the gate of that row.
        first: index at which each target's rows begin, see `targets`.
        rows: rows of `GateTarget`.
        obstacles: rows of obstacles for `sees`.
        target: the target's index.
        x: state, position first [m].
    """
    target = min(target, len(first) - 2)
    begin = first[target]
    at_gate = first[target + 1] - 1
    if target > 0 and still_in_gate(x, rows[begin - 1]):
        return begin - 1

    # The rows on the way whose planes x has not crossed
    p = x[:3]
    exits = columns(rows, GateTarget, "x", "z")
    passages = columns(rows, GateTarget, "nx", "nz")
    ahead = [row for row in range(begin, at_gate) if (p - exits[row]) @ passages[row] < 0.0]

    nearest = ahead[0] if ahead else at_gate

    # The first row in sight, searching backwards from the gate
    later = np.arange(at_gate, nearest, -1)
    here = np.repeat(p[None], len(later), axis=0)
    in_sight = later[sees(here, exits[later], obstacles)]
    return int(in_sight[0]) if len(in_sight) else nearest
