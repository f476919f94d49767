"""The way to a gate: straight, or round its frame for a vehicle that is behind it.

Some courses have ladders: two gates in one plane that are flown one after the other in the same
direction. Behind the first gate the straight way to the second one leads through bars, and a plan
that follows it hovers there. Out of a gate that is flown straight down, a vehicle may come behind
the frame of the next gate, where the straight way leads through bars, too. So on courses with such
gates the term `progress` counts the way round frames. Seen from the left, the passage leads to the
right: the way leads straight to the opening from in front of the gate (a), forward from beside its
frame (b), and round the frame's outer edge from behind it (c).

              .------------------.
              |       ____       |
              |      |    |      |
              |      |bar |      c
              v      |____|
      a ------>-----> opening
              ^       ____
              |      |    |
              |      |bar |
              |      |____|
              '------- b

Frames that stand side by side or one above the other, with no room for the vehicle between them,
are one frame for the way round.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy import maximum, sqrt, where

from quadsim.controllers.costs.cost import Cost, Term
from quadsim.controllers.costs.frames import SAFETY_MARGIN
from quadsim.controllers.costs.race_step import at_gate, in_gate, is_beside
from quadsim.controllers.costs.room import Room
from quadsim.course import Course, Gate
from quadsim.course.frames import frames
from quadsim.course.opening import half_sizes, outer_half_sizes
from quadsim.dynamics.named_tuples import column

# Two gates are in one plane if they are at most so far apart along the passage [m], and the cosine
# of the angle between their passages is at least so large.
SAME_PLANE = 0.5
PARALLEL = 0.9
# Least sine of the angle between a steep passage and the ground
STEEP = 0.7
# Least room between two frames through which the way round leads, in clearances of the vehicle
PASSABLE = 4.0
# Added to the distance of a side at which the room ends [m]
BLOCKED = 1000.0


class Sides(NamedTuple):
    """Distances from the middle of an opening to its sides, where the vehicle is clear of them [m].

    Frames beside the gate that leave the vehicle no room between them belong to the gate's frame.
    A side at which the room ends is far away.
    """

    round_left: float
    round_right: float
    round_up: float
    round_down: float


class LastOpening(NamedTuple):
    """The free opening of the gate before, in the plane of a gate [m].

    The half sizes are negative if it does not lie in this plane.
    """

    last_left: float  # of its middle, from the middle of the gate's opening
    last_up: float
    last_y: float  # half width and half height
    last_z: float


NO_LAST = LastOpening(0.0, 0.0, -1.0, -1.0)
# Sides of a target without a frame [m]
NO_FRAME = Sides(0.1, 0.1, 0.1, 0.1)


def way_to_gate(place, gate, opening):
    """Return the distance to fly to the exit of a gate [m].

    In front of the gate and within its opening the way is straight. From beside the frame it leads
    through a point that lies `gate.approach` in front of the gate, and likewise from behind the
    opening of the gate before if that lies in the same plane. From other places behind the gate it
    leads round the nearest outer edge of the frame, and is longer by two approaches, as the vehicle
    has to turn.

    Args:
        place: InGate.
        gate: GateTarget with the numbers of Sides and LastOpening.
        opening: share of the opening to whose nearest point the distance is measured.
    """
    half_left = opening * (gate.free_y - gate.margin)
    half_up = opening * (gate.free_z - gate.margin)
    off_left = maximum(abs(place.left) - half_left, 0.0)
    off_up = maximum(abs(place.up) - half_up, 0.0)
    beside_last = maximum(
        abs(place.left - gate.last_left) - gate.last_y, abs(place.up - gate.last_up) - gate.last_z
    )
    is_behind = (place.along > 0.0) & (beside_last > 0.0)
    has_missed = is_beside(place, gate)

    # How far it is aside to the outer edge of the frame, negative beside the frame, and from there
    # to the opening: the shorter way of up and down, then of left and right
    above = gate.round_up - place.up
    below = gate.round_down + place.up
    is_over = above + gate.round_up < below + gate.round_down
    out_up = where(is_over, above, below)
    in_up = maximum(where(is_over, gate.round_up, gate.round_down) - half_up, 0.0)
    to_left = gate.round_left - place.left
    to_right = gate.round_right + place.left
    is_left = to_left + gate.round_left < to_right + gate.round_right
    out_left = where(is_left, to_left, to_right)
    in_left = maximum(where(is_left, gate.round_left, gate.round_right) - half_left, 0.0)

    # The shorter one of these. It leads to the edge of the frame's back, or past it to the front.
    is_upright = maximum(out_up, 0.0) + in_up < maximum(out_left, 0.0) + in_left
    out = where(is_upright, out_up, out_left)
    inward = where(is_upright, in_up, in_left)
    is_hidden = is_behind & (out > 0.0)

    forward = where(has_missed, place.along + gate.approach, place.along)
    along = where(is_hidden, place.along, where(is_behind, place.along + gate.depth, forward))
    left = where(is_behind, out, off_left)
    up = where(is_behind, where(is_upright, off_left, off_up), off_up)
    straight = sqrt(along * along + left * left + up * up + 1e-6)

    around = inward + where(is_hidden, gate.depth, 0.0)
    more = gate.approach + where(is_behind, gate.approach + around, 0.0)
    return straight + where(is_behind | has_missed, more, 0.0)


def progress(x, x_next, u, gate, p):
    """Return the remaining distance to fly, with the way round frames [m]."""
    way = way_to_gate(in_gate(x_next.position, gate), gate, p.opening)
    return where(at_gate(x, x_next, gate).reached, 0.0, way) + gate.to_go


def leads_beside_frames(course: Course) -> bool:
    """Return whether straight ways to gates lead vehicles beside or behind their frames.

    They do on a course with a ladder, or with a gate that is flown steeply up or down.
    """
    after_another = list(with_gate_before(course))[0 if course.loop else 1 :]
    has_ladder = any(is_ladder(last, gate) for last, gate in after_another)
    return has_ladder or any(abs(gate.rotation[2, 0]) > STEEP for gate in course.gates)


def with_gate_before(course: Course) -> Iterator[tuple[Gate, Gate]]:
    """Yield the gate before each gate, and the gate; the last gate is before the first one."""
    return zip(course.gates[-1:] + course.gates[:-1], course.gates, strict=True)


def is_ladder(last: Gate, gate: Gate) -> bool:
    """Return whether two gates stand in one plane, side by side, and are flown in one direction."""
    along, left, up = np.subtract(last.position, gate.position) @ gate.rotation
    is_parallel = last.rotation[:, 0] @ gate.rotation[:, 0] > PARALLEL
    half = half_sizes(gate.opening)
    is_aside = abs(left) > half.left or abs(up) > half.up
    return bool(is_parallel and abs(along) < SAME_PLANE and is_aside)


def with_ways_round_frames(
    cost: Cost, course: Course, radius: float, room: Room, first: Sequence[int]
) -> Cost:
    """Return the racing cost of a course with ladders or steep gates.

    Args:
        cost: the racing cost, whose rows begin with the fields of `GateTarget`.
        course: the course.
        radius: radius of the vehicle [m].
        room: the room in which the vehicle may fly.
        first: index at which the rows of each gate begin, see `race_targets.targets`.
    """
    corners = np.array([gate.corners(gate.frame_width) for gate in frames(course.gates)])
    of_gates = [
        (*sides_of(gate, corners, radius, room), *last_opening(gate, last, radius))
        for last, gate in with_gate_before(course)
    ]
    # The row of a gate is the last one on the way to it. Rows before it, and the finish, have no
    # frame.
    added = np.tile((*NO_FRAME, *NO_LAST), (len(cost.targets), 1))
    ends = np.array(first[1:-1]) - 1
    added[ends] = np.resize(of_gates, (len(ends), added.shape[1]))
    row: Any = row_round_frames(cost.row)
    targets = np.hstack([cost.targets, added])

    # Distances between gates, measured as in the term `progress`. Behind the first gate of a ladder
    # there are two ways to the second one. The longer one counts, so that a plan gains by passing
    # the first gate wherever it goes on: with the shorter one, vehicles hovered in front of it.
    rows = [row(*numbers) for numbers in targets]
    to_go = column(targets, row, "to_go")
    ways = -np.diff(to_go)
    for k, (before, target) in enumerate(pairwise(rows)):
        place = in_gate((before.x, before.y, before.z), target)
        if place.along > -1e-6:
            behind = place._replace(along=maximum(place.along, 1e-6))
            round_it = target._replace(**NO_LAST._asdict())
            ways[k] = max(way_to_gate(behind, each, 0.0) for each in (target, round_it))
    to_go[:-1] = np.cumsum(ways[::-1])[::-1]

    counted = Term(progress, next(t.weight for t in cost.terms if t.name == "progress"))
    terms = tuple(counted if term.name == counted.name else term for term in cost.terms)
    return replace(cost, name=f"{cost.name}_round_frames", row=row, targets=targets, terms=terms)


@lru_cache(maxsize=16)
def row_round_frames(row: Any) -> Any:
    """Return the type of target rows with the numbers of Sides and LastOpening after these."""
    names = row._fields + Sides._fields + LastOpening._fields
    return namedtuple(f"{row.__name__}RoundFrames", names)


def last_opening(gate: Gate, last: Gate, radius: float) -> LastOpening:
    """Return the opening of the gate before as it lies in the plane of a gate.

    Args:
        gate: the gate.
        last: the gate before.
        radius: radius of the vehicle [m].
    """
    clear = radius + SAFETY_MARGIN
    corners = (last.corners(-clear) - gate.position) @ gate.rotation  # (4, 3)
    if abs(corners[:, 0]).max() > 2.0 * clear + gate.frame_depth:
        return NO_LAST
    low, high = corners[:, 1:].min(axis=0), corners[:, 1:].max(axis=0)
    left, up = ((low + high) / 2.0).tolist()
    half_left, half_up = ((high - low) / 2.0).tolist()
    is_same_frame = abs(left) < half_left and abs(up) < half_up
    return NO_LAST if is_same_frame else LastOpening(left, up, half_left, half_up)


def sides_of(gate: Gate, frames: np.ndarray, radius: float, room: Room) -> Sides:
    """Return the distances from the middle of a gate to its sides, where the way round leads past.

    Args:
        gate: the gate.
        frames: outer corners of all frames of the course [m]  (frames, 4, 3).
        radius: radius of the vehicle [m].
        room: the room in which the vehicle may fly.
    """
    clear = radius + SAFETY_MARGIN
    left, up = outer_half_sizes(gate.opening, gate.frame_width)
    low, high = np.array([-left, -up]), np.array([left, up])

    # Frames in the plane of the gate, as rectangles in it
    inside = (frames - gate.position) @ gate.rotation  # (frames, 4, 3)
    in_plane = np.abs(inside[:, :, 0]).max(axis=1) < 2.0 * clear + gate.frame_depth
    flat = inside[in_plane, :, 1:]  # (frames, 4, 2)

    # Take in the frames with too little room between them and those taken in so far
    gap = PASSABLE * clear
    for _ in flat[1:]:
        lowest, highest = flat.min(axis=1), flat.max(axis=1)
        near = ((lowest < high + gap) & (highest > low - gap)).all(axis=1)
        low = np.minimum(low, lowest[near].min(axis=0))
        high = np.maximum(high, highest[near].max(axis=0))
    low, high = low - clear, high + clear
    distances = np.array([high[0], -low[0], high[1], -low[1]])

    # There is no way past a side at which the room ends.
    _, to_left, to_up = gate.rotation.T
    directions = np.array([to_left, -to_left, to_up, -to_up])
    places = gate.position + distances[:, None] * directions
    room_low = (room.x_low, room.y_low, room.floor)
    room_high = (room.x_high, room.y_high, room.z_high)
    is_free = ((places >= room_low) & (places <= room_high)).all(axis=1)
    if is_free.any():
        distances = distances + np.where(is_free, 0.0, BLOCKED)
    return Sides(*distances.tolist())
