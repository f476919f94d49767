"""One step of a sample at its gate: the geometry that the terms of the racing cost share."""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy import maximum, where

from quadsim.controllers.costs.race_targets import cross
from quadsim.course import in_frame
from quadsim.course.opening import InGate

# Share of a gate's depth from which on a vehicle counts as beside the frame. The exit of a gate may
# lie in the entry plane of the next one.
BESIDE = 0.9


class RaceParams(NamedTuple):
    """The parameters of the terms, and the room in which samples may fly [m]."""

    desired_speed: float  # [m/s]
    waypoint_radius: float  # [m]
    opening: float  # share of the opening to whose nearest point progress is measured

    # The fields of quadsim.controllers.costs.room.Room
    floor: float
    x_low: float
    x_high: float
    y_low: float
    y_high: float
    z_high: float


class StepAtGate(NamedTuple):
    """One step of a sample at its gate."""

    # Whether the step crosses the exit plane within the free opening
    reached: Any
    # Whether the step touches the frame
    clipped: Any
    # Whether the step ends between entry and exit, or crosses the exit, not outside the frame
    within: Any
    # Distance of that point outside the free opening, negative inside, times span [m^2]
    outside: Any
    # Distance outside the free opening at the entry plane, times span; -1 off this plane [m^2]
    outside_entry: Any
    # Displacement along the passage [m]
    span: Any


def in_gate(p, gate):
    """Return the position p in the frame of the gate's exit: along the passage, left, up."""
    passage = (gate.nx, gate.ny, gate.nz)
    left = (gate.lx, gate.ly, gate.lz)
    return InGate(*in_frame(off_exit(p, gate), passage, left, cross(passage, left)))


def is_beside(place, gate):
    """Return whether a position is outside a gate's opening, beside the frame or behind it.

    Args:
        place: InGate.
        gate: GateTarget.
    """
    outside = maximum(abs(place.left) - gate.free_y, abs(place.up) - gate.free_z) > 0.0
    return (place.along > -BESIDE * gate.depth) & outside


def off_exit(p, gate):
    """Return the vector from the gate's exit to the position p, world frame."""
    x, y, z = p
    return x - gate.x, y - gate.y, z - gate.z


def at_gate(x, x_next, gate):
    """Return the StepAtGate of the step from x to x_next.

    The step is checked at its crossings of the entry and the exit plane and at its end. These
    points suffice, as the free opening is convex; at 50 m/s a step is longer than the depth of a
    gate. `at_exit` and `at_entry` are the distances outside the free opening at these crossings,
    times span: such products need no division, and their sum over the steps within a gate does not
    depend on the speed.
    """
    before = in_gate(x.position, gate)
    after = in_gate(x_next.position, gate)
    free_y, free_z, bar, depth = gate.free_y, gate.free_z, gate.bar, gate.depth
    forward = (before.along < 0.0) & (after.along >= 0.0)
    backward = (before.along >= 0.0) & (after.along < 0.0)
    through_entry = (before.along <= -depth) != (after.along <= -depth)
    span = abs(after.along - before.along)

    # Crossing of the exit plane
    at_exit = maximum(
        abs(before.left * after.along - after.left * before.along) - free_y * span,
        abs(before.up * after.along - after.up * before.along) - free_z * span,
    )

    # Crossing of the entry plane
    entry_before = before.along + depth
    entry_after = after.along + depth
    at_entry = maximum(
        abs(before.left * entry_after - after.left * entry_before) - free_y * span,
        abs(before.up * entry_after - after.up * entry_before) - free_z * span,
    )

    # End of the step
    at_end = maximum(abs(after.left) - free_y, abs(after.up) - free_z)
    ends_in = (after.along > -depth) & (after.along < 0.0) & (at_end < bar)

    # The step touches the frame at the exit, from either side, at the entry, or by ending within
    # the frame.
    clipped = (forward & (at_exit >= 0.0) & (at_exit < bar * span)) | (
        backward & (at_exit < bar * span)
    )
    clipped = (
        clipped
        | (through_entry & (at_entry >= 0.0) & (at_entry < bar * span))
        | (ends_in & (at_end >= 0.0))
    )
    return StepAtGate(
        reached=forward & (at_exit < 0.0),
        clipped=clipped,
        within=ends_in | (forward & (at_exit < bar * span)),
        outside=where(forward, at_exit, at_end * span),
        outside_entry=where(through_entry, at_entry, -1.0),
        span=span,
    )
