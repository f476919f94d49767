"""What a course file may say: its keys, units, ranges and defaults. Geometry is checked in course_checks."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct

from quadsim.files.strict_yaml import unit

Metre = Annotated[float, unit("m", ge=-1e4, le=1e4)]
Size = Annotated[float, unit("m", gt=0, le=100)]
Degree = Annotated[float, unit("deg", ge=-360, le=360)]
Second = Annotated[float, unit("s", gt=0)]
Point = tuple[Metre, Metre, Metre]
Span = tuple[Metre, Metre]
Name = Annotated[str, Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]  # names folders of runs


class GateEntry(Struct, frozen=True, kw_only=True):
    position: Point
    yaw_deg: Degree
    pitch_deg: Degree = 0.0
    roll_deg: Degree = 0.0
    opening: tuple[Size, Size] | None = None  # the course's
    frame_width: Size | None = None  # the course's


class StartEntry(Struct, frozen=True, kw_only=True):
    position: Point
    yaw_deg: Degree


class PublishedEntry(Struct, frozen=True, kw_only=True):
    who: str
    time: Second


class CourseFile(Struct, frozen=True, kw_only=True):
    name: Name | None = None  # the file's
    source: str = ""
    loop: bool = False
    laps: Annotated[int, Meta(ge=1, le=1000)] = 1
    opening: tuple[Size, Size]
    frame_width: Size = 0.275  # Swift's gates: 1.5 m openings in a 2.05 m frame
    bounds: tuple[Span, Span, Span] | None = None  # around start and gates with room to fly
    start: StartEntry
    gates: Annotated[tuple[GateEntry, ...], Meta(min_length=1)]
    published: tuple[PublishedEntry, ...] = ()
