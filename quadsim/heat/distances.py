"""Default distances of a race of several vehicles, from their sizes, the openings and the room."""

from __future__ import annotations

from collections.abc import Sequence

from quadsim.course import Course
from quadsim.files.values import SettingError
from quadsim.heat.grid import SPACING, place_fault, start_grid

# Largest default clearance [m]; the vehicles and courses of the races of UZH get it
KEEP = 0.6
# Share of the smallest side of an opening: a vehicle that passes in its middle is not pushed into
# the frame by another one that waits beside the frame
SHARE_OF_OPENING = 0.5
# Least clearance and least spacing, in distances at which two vehicles touch
LEAST_KEEP = 1.25
LEAST_SPACING = 2.0
STEPS = 20  # spacings that are tried, from SPACING down


def default_keep(course: Course, radii: Sequence[float]) -> float:
    """Return the clearance to other vehicles that planners keep by default [m].

    It is 0.6 m if no opening is narrower than 1.2 m. With smaller openings it is half of the
    narrowest one, but at least 1.25 times the distance at which the two largest vehicles touch.

    Args:
        course: the course.
        radii: radii of the vehicles [m].

    Examples:
        >>> import quadsim
        >>> from quadsim.heat.distances import default_keep
        >>> default_keep(quadsim.load_course("split_s_swift"), [0.14, 0.14])
        0.6
        >>> default_keep(quadsim.load_course("lsy_level2"), [0.07, 0.07])
        0.2
    """
    narrowest = min(side for gate in course.gates for side in gate.opening)
    wanted = max(SHARE_OF_OPENING * narrowest, LEAST_KEEP * touching_distance(radii))
    return round(min(KEEP, wanted), 3)  # to the millimetre


def default_spacing(course: Course, radii: Sequence[float]) -> float:
    """Return the distance between neighbouring starts by default [m].

    It is 1 m if all vehicles have room at this spacing. Otherwise it is the largest multiple of
    0.05 m at which they have room, but at least twice the distance at which the two largest
    vehicles touch. If there is no such multiple, it is 1 m.

    Args:
        course: the course.
        radii: radii of the vehicles [m].

    Examples:
        >>> import quadsim
        >>> from quadsim.heat.distances import default_spacing
        >>> default_spacing(quadsim.load_course("lsy_level2"), [0.07] * 4)
        0.45
    """
    least = LEAST_SPACING * touching_distance(radii)
    tried = (SPACING * k / STEPS for k in range(STEPS, 0, -1))
    fits = (each for each in tried if each >= least and has_room(course, len(radii), each))
    return next(fits, SPACING)


def touching_distance(radii: Sequence[float]) -> float:
    """Return the distance of centres at which the two largest vehicles touch [m].

    It is 0 for a single vehicle.
    """
    return sum(sorted(radii)[-2:]) if len(radii) > 1 else 0.0


def has_room(course: Course, places: int, spacing: float) -> bool:
    """Return whether each place on the start grid has room.

    Args:
        course: the course.
        places: the number of places.
        spacing: distance between neighbouring places [m].
    """
    try:
        grid = start_grid(course, places, spacing)
    except SettingError:
        return False
    return not any(place_fault(course, start) for start in grid)
