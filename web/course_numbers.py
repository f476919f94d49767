"""The numbers of a course's parts that can be typed on the page, with their ranges and units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from quadsim.course.course_file import (
    BoxEntry,
    CylinderEntry,
    GateEntry,
    ObstacleEntry,
    Point,
    Span,
    StartEntry,
)

Bounds = tuple[Span, Span, Span]
# A part of a course file with all its numbers
Part = GateEntry | StartEntry | BoxEntry | CylinderEntry | Bounds


class Number(NamedTuple):
    """A number that can be typed."""

    label: str
    low: float
    high: float
    step: float


Values = Mapping[Number, float]


def _place(label: str) -> Number:
    return Number(f"{label} [m]", -1e4, 1e4, 0.1)


def _angle(label: str) -> Number:
    return Number(f"{label} [deg]", -360.0, 360.0, 5.0)


def _size(label: str) -> Number:
    # 0 can be typed, and the checks report it as an error
    return Number(f"{label} [m]", 0.0, 100.0, 0.1)


POSITION = (_place("x"), _place("y"), _place("z"))
YAW = _angle("Yaw")
ATTITUDE = (YAW, _angle("Pitch"), _angle("Roll"))
OPENING = (_size("Opening width"), _size("Opening height"))
FRAME = _size("Frame width")
BOX = (_size("Size along x"), _size("Size along y"), _size("Size along z"))
RADIUS = _size("Radius")
HEIGHT = _size("Height")
SPANS = tuple(_place(f"{axis} {end}") for axis in "xyz" for end in ("least", "most"))
NUMBERS = (*POSITION, *ATTITUDE, *OPENING, FRAME, *BOX, RADIUS, HEIGHT, *SPANS)


def numbers_of(part: Part) -> dict[Number, float]:
    """Return the numbers of a part of a course.

    Raises:
        ValueError: a gate lacks its own opening or frame.
    """
    match part:
        case GateEntry(opening=None) | GateEntry(frame_width=None):
            raise ValueError("expected a gate with an opening and a frame of its own")
        case GateEntry(opening=opening, frame_width=frame) if opening and frame is not None:
            angles = (part.yaw_deg, part.pitch_deg, part.roll_deg)
            names = (*POSITION, *ATTITUDE, *OPENING, FRAME)
            return _named(names, (*part.position, *angles, *opening, frame))
        case StartEntry():
            return _named((*POSITION, YAW), (*part.position, part.yaw_deg))
        case BoxEntry():
            return _named((*POSITION, YAW, *BOX), (*part.centre, part.yaw_deg, *part.size))
        case CylinderEntry():
            return _named((*POSITION, RADIUS, HEIGHT), (*part.base, part.radius, part.height))
    x, y, z = part  # pyright: ignore[reportGeneralTypeIssues]
    return _named(SPANS, (*x, *y, *z))


def with_numbers(part: Part, changed: Values) -> Part:
    """Return a part of a course with changed numbers.

    Raises:
        KeyError: the part has no such number.
    """
    numbers = numbers_of(part)
    for number, value in changed.items():
        if number not in numbers:
            raise KeyError(number.label)
        numbers[number] = float(value)
    match part:
        case GateEntry():
            yaw, pitch, roll = (numbers[angle] for angle in ATTITUDE)
            width, height = (numbers[size] for size in OPENING)
            return GateEntry(
                position=_position(numbers),
                yaw_deg=yaw,
                pitch_deg=pitch,
                roll_deg=roll,
                opening=(width, height),
                frame_width=numbers[FRAME],
            )
        case StartEntry():
            return StartEntry(position=_position(numbers), yaw_deg=numbers[YAW])
        case BoxEntry():
            x, y, z = (numbers[size] for size in BOX)
            return BoxEntry(centre=_position(numbers), size=(x, y, z), yaw_deg=numbers[YAW])
        case CylinderEntry():
            return CylinderEntry(
                base=_position(numbers), radius=numbers[RADIUS], height=numbers[HEIGHT]
            )
    x_least, x_most, y_least, y_most, z_least, z_most = (numbers[end] for end in SPANS)
    return (x_least, x_most), (y_least, y_most), (z_least, z_most)


def as_obstacle(part: BoxEntry | CylinderEntry) -> ObstacleEntry:
    """Return the entry of an obstacle."""
    if isinstance(part, BoxEntry):
        return ObstacleEntry(box=part)
    return ObstacleEntry(cylinder=part)


def _named(numbers: Sequence[Number], values: Sequence[float]) -> dict[Number, float]:
    return dict(zip(numbers, values, strict=True))


def _position(numbers: Values) -> Point:
    x, y, z = (numbers[axis] for axis in POSITION)
    return x, y, z
