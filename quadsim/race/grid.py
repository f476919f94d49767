"""The start grid: places on an arc that faces gate 1, in rows of four."""

from __future__ import annotations

from math import atan2, cos, dist, hypot, sin

from quadsim.course import Course, Start
from quadsim.course.swept import SweptGates
from quadsim.course.swept_obstacles import SweptObstacles
from quadsim.files.values import SettingError

ROW = 4  # places in a row
LARGEST_TURN = 1.2  # of a place on the arc, from the middle [rad]


def start_grid(course: Course, places: int, spacing: float) -> list[Start]:
    """Return the places in which vehicles start.

    The first row is on the arc around gate 1 that leads through the course's own start; further
    rows are behind it. One place is the course's own start. Each heading is turned as its place is.

    Args:
        course: the course.
        places: the number of places.
        spacing: distance of neighbours, in a row and between rows [m].

    Raises:
        SettingError: the start is too near to gate 1 for such an arc.
    """
    start = course.start
    x, y, z = start.position
    gate_x, gate_y, _ = course.gates[0].position
    radius = hypot(x - gate_x, y - gate_y)
    bearing = atan2(y - gate_y, x - gate_x)

    grid = []
    for place in range(places):
        row, column = divmod(place, ROW)
        in_row = min(places - ROW * row, ROW)
        aside = (column - (in_row - 1) / 2) * spacing
        if aside == 0.0 and row == 0:
            grid.append(start)
            continue
        if abs(aside) > LARGEST_TURN * radius:
            wanted = f"at most {2 * LARGEST_TURN * radius / max(in_row - 1, 1):.2f} m"
            why = f"as gate 1 of {course.name} is {radius:.2f} m from the start"
            raise SettingError("spacing", f"expected {wanted}, {why}, got {spacing:g}")
        turn = aside / radius
        away = radius + row * spacing
        position = (
            gate_x + away * cos(bearing + turn),
            gate_y + away * sin(bearing + turn),
            z,
        )
        grid.append(Start(position, start.yaw + turn))
    return grid


def check_place(course: Course, start: Start, place: int, radius: float) -> None:
    """Check that a vehicle has room in its place.

    Args:
        course: the course.
        start: the place.
        place: its number, from 1, for the error.
        radius: radius of the vehicle [m].

    Raises:
        SettingError: it stands in a gate, in an obstacle, or out of bounds.
    """
    p = start.position
    inside = ""
    for swept in SweptGates(course.gates, radius).all:
        local = swept.gate.to_local(p)
        if swept.touch(local, local) is not None:
            inside = f"gate {swept.index + 1}"
    for incident in SweptObstacles(course.obstacles, radius).incidents(p, p):
        inside = incident.touched
    for (low, high), number in zip(course.bounds, p, strict=True):
        if not low <= number <= high:
            inside = "a place out of bounds"
    if inside:
        at = ", ".join(f"{number:.2f}" for number in p)
        raise SettingError(
            "spacing", f"expected room for all starts, got place {place} at ({at}) m in {inside}"
        )


def check_apart(grid: list[Start], radii: list[float], least: float | None) -> None:
    """Check that no two vehicles are in contact on the grid.

    Args:
        grid: the places of the vehicles.
        radii: their radii [m].
        least: distance of centres that counts as a contact [m]; None: that at which they touch.

    Raises:
        SettingError: two of them are.
    """
    for k, a in enumerate(grid):
        for m in range(k):
            reach = radii[k] + radii[m] if least is None else least
            between = dist(a.position, grid[m].position)
            if between <= reach:
                wanted = f"expected starts more than {reach:g} m apart"
                raise SettingError("spacing", f"{wanted}, got places {m + 1} and {k + 1}")
