"""The rows of numbers that samples of the racing cost fly to: a gate's exit, its free opening, the
way that is left."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from controllers.costs.frames import SAFETY_MARGIN, inner_margin
from controllers.costs.ways_round import Stop, sees, stops_between
from quadsim.course import Course, EstimatedGate, Gate, in_frame
from quadsim.course.opening import (
    HalfSizes,
    Offset,
    approach_length,
    beyond,
    free_half_sizes,
    half_depth,
)
from quadsim.dynamics.records import as_rows, columns

GATE_STDS = 2.5  # standard deviations of a gate's estimated position that are added to the margin
MARGIN_LIMIT = 0.7  # share of half the free opening that margin and uncertainty take at most
# [m] from the last gate to a last target behind it, so that plans do not end at the finish
RUN_OUT = 100.0


class GateTarget(NamedTuple):
    """A target row describes a place that a sample flies to: the exit of a gate, a point beside an
    obstacle, or a point behind the finish.

    The picture in controllers.costs.race shows the sizes. Positions and directions are those of the
    world.
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
    bar: float  # thickness of the bars around it, grown by radius and margins [m]
    to_go: float  # from this exit to the last one, along the rows between them [m]
    # from the gate to the point in front of it to which a vehicle behind it flies first [m]
    approach: float

    # Unit vector along the leg, which leads from the exit before to this one, and its length [m]
    ex: float
    ey: float
    ez: float
    leg: float

    margin: float  # wanted between vehicle and frame [m]
    depth: float  # from entry plane to exit plane [m]


def cross(a, b):
    """The cross product of two vectors of three numbers.  (3,)"""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def targets(
    course: Course, radius: float, margin: tuple[float, float], room: Sequence[float], laps: int
) -> tuple[np.ndarray, list[int]]:
    """Return the target rows of a race, and where the rows of each gate, and of the finish, begin.

    There is one row for each gate of every lap, before it one for each point of the way round
    obstacles to it, and one behind the finish.

    Args:
        course: its start, gates and obstacles.
        radius: of the vehicle [m].
        margin: wanted between vehicle and frame [m], and the share of half the free opening that it
            takes at most.
        room: where the vehicle may fly, of `room_to_fly` [m].
        laps: to fly.

    Returns:
        Rows of `GateTarget`, (rows, 20), and indices of rows, (gates of all laps + 2,), the last of
        them their number.
    """
    at_gates = [
        gate_stop(gate, radius, margin, exit_distance(gate, radius, room))
        for gate in course.gates * laps
    ]
    stops_at = [*at_gates, finish_stop(course.gates[-1], radius, margin)]
    between = stops_between(course, stops_at, radius + 2 * SAFETY_MARGIN, room)
    # to each gate, and to the finish
    on_the_way = [[*between.get(k, ()), stop] for k, stop in enumerate(stops_at)]
    first = np.cumsum([0, *map(len, on_the_way)]).tolist()
    return target_rows(course, [stop for stops in on_the_way for stop in stops]), first


def gate_stop(gate: Gate, radius: float, margin: tuple[float, float], behind: float) -> Stop:
    """Return the stop at a gate's exit.

    Args:
        gate: to fly through.
        radius: of the vehicle [m].
        margin: wanted between vehicle and frame [m], and the share of half the free opening that it
            takes at most.
        behind: from the gate's plane to the exit [m].
    """
    passage, left = gate.rotation[:, 0], gate.rotation[:, 1]
    inner = inner_margin(gate, radius)
    free = free_half_sizes(gate.opening, radius, inner)

    # A narrow gate leaves less than the margin; where a gate stands is not known exactly, and asks
    # for more
    wanted = min(margin[0], margin[1] * min(free))
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
        depth=behind + clear_of_frame(radius),
    )


def finish_stop(last: Gate, radius: float, margin: tuple[float, float]) -> Stop:
    """Return the stop far behind the last gate, where no frame stands.  Arguments: see
    `gate_stop`"""
    return gate_stop(last, radius, margin, RUN_OUT)._replace(free=HalfSizes(RUN_OUT, RUN_OUT))


def target_rows(course: Course, stops: Sequence[Stop]) -> np.ndarray:
    """Return the target rows of stops, with the legs that lead to them from the start on.  (stops,
    20)"""
    exits = np.array([stop.exit for stop in stops])
    passages = np.array([stop.passage for stop in stops])
    approaches = np.array([stop.approach for stop in stops])
    legs = np.diff([course.start.position, *exits], axis=0)
    lengths = np.maximum(np.linalg.norm(legs, axis=1), 1e-6)
    directions = legs / lengths[:, None]

    # The way from gate to gate as terms() measures it, round a gate that faces away: no jump of the
    # cost at a gate
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


def clear_of_frame(radius: float) -> float:
    """Return the distance from a gate's plane to its entry, and to its exit, where the vehicle is
    clear of it [m]."""
    return half_depth(radius, SAFETY_MARGIN)


def exit_distance(gate: Gate, radius: float, room: Sequence[float]) -> float:
    """Return the distance from a gate's plane to its exit: where the room ends sooner, half of the
    way there [m].

    Args:
        gate: to fly through.
        radius: of the vehicle [m].
        room: where the vehicle may fly, of `room_to_fly` [m].
    """
    floor, x_low, x_high, y_low, y_high, z_high = room
    distances = [clear_of_frame(radius)]
    sides = ((x_low, x_high), (y_low, y_high), (floor, z_high))
    for centre, way, (low, high) in zip(gate.position, gate.axes[0], sides, strict=True):
        if abs(way) > 1e-9:
            distances.append(((high if way > 0.0 else low) - centre) / way / 2)
    return max(min(distances), 1e-3)


def is_inside(clear: float, x: np.ndarray, row: np.ndarray) -> bool:
    """Return whether x is past a gate's plane, within its outline, but not yet at its exit.

    Args:
        clear: from the gate's plane to its entry plane, of `clear_of_frame` [m].
        x: state, position first [m].
        row: of `GateTarget`.
    """
    target = GateTarget(*row)
    passage, left = (target.nx, target.ny, target.nz), (target.lx, target.ly, target.lz)
    from_exit = x[0] - target.x, x[1] - target.y, x[2] - target.z
    along, y, z = in_frame(from_exit, passage, left, cross(passage, left))
    past_the_plane = clear - target.depth <= along < 0.0
    outside = beyond(Offset(y, z), HalfSizes(target.free_y, target.free_z))
    return bool(past_the_plane and outside < target.bar)


def row_ahead(
    still_in_gate: Callable,
    first: Sequence[int],
    rows: np.ndarray,
    obstacles: np.ndarray,
    target: int,
    x: np.ndarray,
) -> int:
    """Return the row to fly to on the way to a target, where rows stand between gates.

    It is the last that is in sight of x, or the first whose plane x has not crossed.

    Args:
        still_in_gate: (x, row) -> whether x has not left the gate of that row.
        first: where each target's rows begin, see `targets`.
        rows: of `GateTarget`.
        obstacles: rows for `sees`.
        target: the target's index.
        x: state, position first [m].
    """
    target = min(target, len(first) - 2)
    begin, at_gate = first[target], first[target + 1] - 1
    if target > 0 and still_in_gate(x, rows[begin - 1]):
        return begin - 1

    # The rows on the way whose planes x has not crossed
    p = x[:3]
    exits, passages = columns(rows, GateTarget, "x", "z"), columns(rows, GateTarget, "nx", "nz")
    ahead = [row for row in range(begin, at_gate) if (p - exits[row]) @ passages[row] < 0.0]

    # From the gate back to the first of them, the first that is in sight
    later = np.arange(at_gate, ahead[0] if ahead else at_gate, -1)
    in_sight = later[sees(np.repeat(p[None], len(later), axis=0), exits[later], obstacles)]
    if len(in_sight):
        return int(in_sight[0])
    return ahead[0] if ahead else at_gate
