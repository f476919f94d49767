"""The numbers of a course's parts that can be typed on the page, from the keys of a course file.

A key of quadsim.course.course_file that holds a number, or several, is offered with the unit, range
and help of its annotation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import product
from typing import Any, NamedTuple

from msgspec import inspect

from quadsim.config.settings import description, unit_of
from quadsim.course.course_file import (
    BoxEntry,
    CourseFile,
    CylinderEntry,
    GateEntry,
    ObstacleEntry,
    Span,
    StartEntry,
)
from quadsim.files.values import bare

Bounds = tuple[Span, Span, Span]
Entry = GateEntry | StartEntry | BoxEntry | CylinderEntry
# A part of a course file with all its numbers
Part = Entry | Bounds

AXES = ("x", "y", "z")
PLACES = ("position", "centre", "base")  # keys of a place, whose numbers are named by their axes
# names of the numbers of a key that has several of them
PARTS = {
    **dict.fromkeys(PLACES, AXES),
    "opening": ("Opening width", "Opening height"),
    "size": tuple(f"Size along {axis}" for axis in AXES),
    "bounds": tuple(f"{axis} {end}" for axis, end in product(AXES, ("least", "most"))),
}
STEPS = {"m": 0.1, "deg": 5.0}  # of a box's arrows


@dataclass(frozen=True)
class Number:
    """A number that can be typed. The same number of another part of a course equals it."""

    label: str
    unit: str
    low: float
    high: float
    help: str = field(default="", compare=False)

    @property
    def step(self) -> float:
        """The step of an arrow key."""
        return STEPS[self.unit]


Values = Mapping[Number, float]


class Key(NamedTuple):
    """A key of a part with its numbers."""

    name: str
    numbers: tuple[Number, ...]
    is_tuple: bool


@cache
def keys_of(cls: type) -> tuple[Key, ...]:
    """Return the keys of a part of a course that hold numbers, in the order of the file."""
    fields = inspect.type_info(cls).fields  # pyright: ignore[reportAttributeAccessIssue]
    return tuple(_key(one.name, one.type) for one in fields)


def _key(name: str, kind: inspect.Type) -> Key:
    """Return a key with its numbers."""
    items = _items(kind)
    label = name.removesuffix("_deg").replace("_", " ").capitalize()
    labels = PARTS.get(name, (label,))
    text = description(kind)
    numbers = [_number(label, item, text) for label, item in zip(labels, items, strict=True)]
    return Key(name, tuple(numbers), is_tuple=name in PARTS)


def _items(kind: inspect.Type) -> list[inspect.Type]:
    """Return the kinds of the numbers of a key, from left to right."""
    inner = bare(kind)
    if isinstance(inner, inspect.TupleType):
        return [item for part in inner.item_types for item in _items(part)]
    return [kind]


def _number(label: str, kind: inspect.Type, text: str) -> Number:
    """Return the form entry of a number: its label, unit, range and help `text`."""
    found: Any = bare(kind)
    # 0 can be typed even if it is out of range; the checks report it as an error.
    low = found.ge if found.ge is not None else found.gt
    return Number(label, unit_of(kind), float(low), float(found.le), text)


def _bounds_key() -> Key:
    fields = inspect.type_info(CourseFile).fields  # pyright: ignore[reportAttributeAccessIssue]
    (bounds,) = [one for one in fields if one.name == "bounds"]
    return _key("bounds", bounds.type)


_GATE = {key.name: key.numbers for key in keys_of(GateEntry)}
_POLE = {key.name: key.numbers for key in keys_of(CylinderEntry)}
POSITION = _GATE["position"]
(YAW,) = _GATE["yaw_deg"]
ATTITUDE = (YAW, *_GATE["pitch_deg"], *_GATE["roll_deg"])
OPENING = _GATE["opening"]
(FRAME,) = _GATE["frame_width"]
(HEIGHT,) = _POLE["height"]
SPANS = _bounds_key().numbers


def numbers_of(part: Part) -> dict[Number, float]:
    """Return the numbers of a part of a course.

    Raises:
        ValueError: a gate lacks its own opening or frame.
    """
    if isinstance(part, tuple):
        return dict(zip(SPANS, [end for span in part for end in span], strict=True))
    found: dict[Number, float] = {}
    for key in keys_of(type(part)):
        value = getattr(part, key.name)
        if value is None:
            raise ValueError("expected a gate with an opening and a frame of its own")
        found |= zip(key.numbers, value if key.is_tuple else (value,), strict=True)
    return found


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
    if isinstance(part, tuple):
        ends = iter(numbers.values())
        x, y, z = zip(ends, ends, strict=True)
        return x, y, z
    values: dict[str, Any] = {}
    for key in keys_of(type(part)):
        found = tuple(numbers[number] for number in key.numbers)
        values[key.name] = found if key.is_tuple else found[0]
    return replace(part, **values)


def as_obstacle(part: BoxEntry | CylinderEntry) -> ObstacleEntry:
    """Return the entry of an obstacle."""
    if isinstance(part, BoxEntry):
        return ObstacleEntry(box=part)
    return ObstacleEntry(cylinder=part)
