"""The keys of a course file, with their units, ranges and defaults."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any

from msgspec import Meta

from quadsim.course.opening import FRAME_DEPTH
from quadsim.files.strict_yaml import setting, unit
from quadsim.files.yaml_text import entries_of

Metre = Annotated[float, unit("m", ge=-1e4, le=1e4)]
Size = Annotated[float, unit("m", gt=0, le=100)]
Degree = Annotated[float, unit("deg", ge=-360, le=360)]
Point = tuple[Metre, Metre, Metre]
Span = tuple[Metre, Metre]
# Folders of runs have the name of their course.
Name = Annotated[str, Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}\Z")]
Second = Annotated[float, unit("s", gt=0)]
# The keys of a course that a gate may have for itself
OF_FRAMES = ("opening", "frame_width", "frame_depth")
# Of a gate in the order of flight; `misnumbered` refuses one that no gate has.
GateNumber = Annotated[int, Meta(ge=-1000, le=1000)]


@dataclass(frozen=True)
class Published:
    """A time on these gates that was published elsewhere."""

    who: Annotated[str, setting("authors of the time")]
    time: Annotated[float, setting("time on these gates", unit="s", gt=0)]


@dataclass(frozen=True, kw_only=True)
class GateEntry:
    """A gate of a course file."""

    position: Annotated[Point, setting("centre of the opening: x east, y north, z up")]
    yaw_deg: Annotated[Degree, setting("direction of the passage: 0 east, 90 north")]
    pitch_deg: Annotated[Degree, setting("pitch of the passage, positive down")] = 0.0
    roll_deg: Annotated[Degree, setting("roll about the passage")] = 0.0
    opening: Annotated[
        tuple[Size, Size] | None, setting("width and height; default: the course's")
    ] = None
    frame_width: Annotated[
        Size | None, setting("width of the bars around the opening; default: the course's")
    ] = None
    frame_depth: Annotated[
        Size | None, setting("depth of the bars along the passage; default: the course's")
    ] = None


@dataclass(frozen=True, kw_only=True)
class StartEntry:
    """The start of a course file."""

    position: Annotated[Point, setting("position at rest")]
    yaw_deg: Annotated[Degree, setting("heading: 0 east, 90 north")]


@dataclass(frozen=True, kw_only=True)
class BoxEntry:
    """A box of a course file."""

    centre: Annotated[Point, setting("centre of the box")]
    size: Annotated[tuple[Size, Size, Size], setting("size along the box's own x, y and z")]
    yaw_deg: Annotated[Degree, setting("direction of the box's x axis")] = 0.0


@dataclass(frozen=True, kw_only=True)
class CylinderEntry:
    """An upright cylinder of a course file."""

    base: Annotated[Point, setting("centre of the lower end")]
    radius: Annotated[Size, setting("radius")]
    height: Annotated[Size, setting("height")]


@dataclass(frozen=True, kw_only=True)
class ObstacleEntry:
    """An obstacle of a course file: a box or a cylinder."""

    box: BoxEntry | None = None
    cylinder: CylinderEntry | None = None


@dataclass(frozen=True, kw_only=True)
class CourseFile:
    """The keys of a course file."""

    name: Annotated[Name | None, setting("name of the course; default: the file's")] = None
    source: Annotated[str, setting("where the course comes from")] = ""
    loop: Annotated[bool, setting("whether the first gate comes after the last")] = False
    laps: Annotated[int, setting("laps of a race on a loop", ge=1, le=1000)] = 1
    opening: Annotated[tuple[Size, Size], setting("width and height of gates' openings")]
    # Swift's gates have openings of 1.5 m in a frame of 2.05 m.
    frame_width: Annotated[Size, setting("width of the bars around an opening")] = 0.275
    frame_depth: Annotated[Size, setting("depth of the bars along the passage")] = FRAME_DEPTH
    bounds: Annotated[
        tuple[Span, Span, Span] | None,
        setting("spans of x, y and z; default: around start, gates and obstacles, with room"),
    ] = None
    start: Annotated[StartEntry, setting("place and heading at rest")]
    gates: Annotated[
        tuple[GateEntry, ...],
        setting("gates, in the order of flight unless `order` gives another", min_length=1),
    ]
    order: Annotated[
        tuple[GateNumber, ...],
        setting(
            "numbers of the gates in the order of flight, from 1, negative for a passage from"
            " behind; default: each once, as they stand"
        ),
    ] = ()
    obstacles: Annotated[
        tuple[ObstacleEntry, ...], setting("boxes and cylinders to keep clear of")
    ] = ()
    published: Annotated[
        tuple[Published, ...], setting("times that reports show beside yours")
    ] = ()


def written_entries(course: CourseFile) -> dict[str, Any]:
    """Return the entries of a course's file, without those at their default.

    The opening or frame of a gate is left out, too, if it equals the course's.
    """
    shared = {key: getattr(course, key) for key in OF_FRAMES}
    gates = []
    for gate in course.gates:
        as_course = [key for key, value in shared.items() if getattr(gate, key) == value]
        gates.append(replace(gate, **dict.fromkeys(as_course)))
    return entries_of(replace(course, gates=tuple(gates)))


def misnumbered(entries: CourseFile) -> tuple[int, str] | None:
    """Return the index and problem of the first number in `order` that no gate has, or None."""
    count = len(entries.gates)
    for i, number in enumerate(entries.order):
        if not 1 <= abs(number) <= count:
            wanted = f"expected the number of a gate, 1 to {count}, or -1 to -{count} from behind"
            return i, f"{wanted}, got {number}"
    return None


def in_flown_order(entries: CourseFile) -> CourseFile:
    """Return the same course with its gates in the order of flight, and without `order`.

    Args:
        entries: entries of a course file; each number in `order` belongs to a gate.
    """
    if not entries.order:
        return entries
    gates = [
        entries.gates[number - 1] if number > 0 else from_behind(entries.gates[-number - 1])
        for number in entries.order
    ]
    return replace(entries, gates=tuple(gates), order=())


def from_behind(gate: GateEntry) -> GateEntry:
    """Return a gate whose legal passage is reversed."""
    yaw = gate.yaw_deg - 180.0 if gate.yaw_deg > 0.0 else gate.yaw_deg + 180.0
    return replace(gate, yaw_deg=yaw, pitch_deg=0.0 - gate.pitch_deg, roll_deg=0.0 - gate.roll_deg)
