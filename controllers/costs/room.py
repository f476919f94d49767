"""The room in which samples may fly: above the ground, and within the bounds of the course."""

from __future__ import annotations

from typing import NamedTuple

from quadsim.controllers.costs.frames import SAFETY_MARGIN
from quadsim.course import Course

FLOOR_MARGIN = 0.1  # [m]


class Room(NamedTuple):
    """The box in which the vehicle's centre may fly: lowest and highest coordinates [m]."""

    floor: float
    x_low: float
    x_high: float
    y_low: float
    y_high: float
    z_high: float


def room_to_fly(course: Course, radius: float, margin: float) -> Room:
    """Return the room in which a vehicle may fly on a course.

    The margin to the ground is limited to FLOOR_MARGIN and to half of the space below the lowest
    gate.

    Args:
        course: the course with bounds and gates.
        radius: radius of the vehicle [m].
        margin: desired distance between vehicle and ground [m].
    """
    (x_low, x_high), (y_low, y_high), (z_low, z_high) = course.bounds
    gap = radius + SAFETY_MARGIN
    lowest = min(gate.position[2] for gate in course.gates)
    floor = gap + max(min(margin, FLOOR_MARGIN, (lowest - gap) / 2), 0.0)
    return Room(
        floor=max(floor, z_low),
        x_low=x_low + gap,
        x_high=x_high - gap,
        y_low=y_low + gap,
        y_high=y_high - gap,
        z_high=z_high - gap,
    )


def leaves_room(x, x_next, p):
    """Return whether the step from x to x_next ends outside the room.

    Args:
        x, x_next: states before and after the step.
        p: parameters with the fields of Room.
    """
    pz = x_next.pz
    # A start on the ground is not a crash; a descent is.
    below_floor = (pz < p.floor) & (pz < x.pz)
    out_x = (x_next.px < p.x_low) | (x_next.px > p.x_high)
    out_of_bounds = out_x | (x_next.py < p.y_low) | (x_next.py > p.y_high) | (pz > p.z_high)
    return below_floor | out_of_bounds
