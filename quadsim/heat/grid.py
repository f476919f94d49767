"""The start grid of a race: places on an arc around gate 1, four in a row.

The middle of the first row is the start of the course, and each further row stands behind the
previous one. Vehicles face gate 1. If gate 1 is nearer than 1.5 m, rows are straight and
vehicles have the yaw of the course's start.
"""

from __future__ import annotations

from dataclasses import replace
from math import asin, atan2, cos, dist, hypot, pi, sin

from quadsim.course import Course, Start
from quadsim.course.checks import problems
from quadsim.files.values import SettingError

IN_ROW = 4  # places in a row
SPACING = 1.0  # between neighbours in a row, and between rows [m]
LEAST_RADIUS = 1.5  # of the arc of a row [m]; a smaller one would be half a circle


def start_grid(course: Course, places: int, spacing: float = SPACING) -> list[Start]:
    """Return the places of the grid, beginning on the right of the first row.

    If there is only one place, it is the course's start.

    Args:
        course: the course.
        places: the number of places.
        spacing: distance between neighbours in a row and between rows [m].

    Raises:
        SettingError: the arc has no room for this spacing.
    """
    if places == 1:
        return [course.start]
    x, y, z = course.start.position
    gate_x, gate_y, _ = course.gates[0].position
    radius = hypot(gate_x - x, gate_y - y)
    from_gate = atan2(y - gate_y, x - gate_x)
    # The widest row is less than half a circle.
    if radius >= LEAST_RADIUS and (IN_ROW - 1) * spacing > pi * radius:
        most = pi * radius / (IN_ROW - 1)
        why = f"as gate 1 of {course.name} is {radius:.2f} m from the start"
        raise SettingError("spacing", f"expected at most {most:.2f} m, {why}, got {spacing:g}")

    starts: list[Start] = []
    for place in range(places):
        row, column = divmod(place, IN_ROW)
        in_this_row = min(IN_ROW, places - row * IN_ROW)
        aside = column - (in_this_row - 1) / 2  # in spacings from the middle, to the left
        behind = row * spacing
        if radius >= LEAST_RADIUS:
            # chords of one spacing; seen from the gate, the left of a vehicle lies clockwise
            r = radius + behind
            angle = from_gate - aside * 2 * asin(spacing / 2 / r)
            position = (gate_x + r * cos(angle), gate_y + r * sin(angle), z)
            yaw = angle + pi
        else:
            yaw = course.start.yaw
            left = aside * spacing
            position = (
                x - behind * cos(yaw) - left * sin(yaw),
                y - behind * sin(yaw) + left * cos(yaw),
                z,
            )
        starts.append(Start(position, yaw))
    return starts


def place_fault(course: Course, start: Start) -> str:
    """Return the problem of a place on the grid, "" if it is valid."""
    found = next(problems(replace(course, start=start)), None)
    return found.problem if found else ""


def check_grid(
    course: Course, starts: list[Start], radii: list[float], contact: float | None
) -> None:
    """Check that vehicles have room on the grid, and are not in contact with each other.

    Args:
        course: the course.
        starts: the places of the vehicles.
        radii: radii of the vehicles [m].
        contact: distance of centres that counts as a contact [m]; None: the distance at which
            two vehicles touch.

    Raises:
        SettingError: a vehicle has no room, or two vehicles are in contact.
    """
    for k, start in enumerate(starts):
        problem = place_fault(course, start)
        if problem:
            at = ", ".join(f"{number:.2f}" for number in start.position[:2])
            raise SettingError("spacing", f"no room for a start at ({at}) m: {problem}")
        for m in range(k):
            reach = radii[k] + radii[m] if contact is None else contact
            if dist(start.position, starts[m].position) <= reach:
                wanted = f"expected starts more than {reach:g} m apart"
                raise SettingError("spacing", f"{wanted}, got two that are nearer")
