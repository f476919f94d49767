"""The check whether a vehicle can fly a course, for `race check` and the course editor."""

from __future__ import annotations

from quadsim.course import Course
from quadsim.course.swept import SweptGates
from quadsim.racing.referee import check
from quadsim.vehicle import Vehicle


def misfit(course: Course, vehicle: Vehicle) -> str:
    """Return one line with the reason why a vehicle cannot fly a course, "" if it can."""
    radius = vehicle.radius
    try:
        check(course, course.laps, SweptGates(course.gates, radius).all, radius)
    except ValueError as error:
        return str(error)
    return ""
