"""Course files: their keys, units, ranges and defaults, how they become a Course, and whether all
fits together."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from math import radians
from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct

from quadsim.course.checks import faults
from quadsim.course.course import Course, Gate, Published, Start
from quadsim.course.obstacles import Box, Cylinder, Obstacle
from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import Document, parse, unit

COURSES = Path(__file__).parents[2] / "courses"
MARGIN = 10.0  # of default bounds around start, gates and obstacles [m]
# of default bounds below the ground [m]: there the ground ends a flight, not the bounds
BELOW_GROUND = 1.0

Metre = Annotated[float, unit("m", ge=-1e4, le=1e4)]
Size = Annotated[float, unit("m", gt=0, le=100)]
Degree = Annotated[float, unit("deg", ge=-360, le=360)]
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


class BoxEntry(Struct, frozen=True, kw_only=True):
    centre: Point
    size: tuple[Size, Size, Size]  # along its own x, y and z
    yaw_deg: Degree = 0.0


class CylinderEntry(Struct, frozen=True, kw_only=True):
    base: Point  # centre of its lower end
    radius: Size
    height: Size


class ObstacleEntry(Struct, frozen=True, kw_only=True):
    """One of both."""

    box: BoxEntry | None = None
    cylinder: CylinderEntry | None = None


class CourseFile(Struct, frozen=True, kw_only=True):
    name: Name | None = None  # the file's
    source: str = ""
    loop: bool = False
    laps: Annotated[int, Meta(ge=1, le=1000)] = 1
    opening: tuple[Size, Size]
    frame_width: Size = 0.275  # Swift's gates: 1.5 m openings in a 2.05 m frame
    # around start, gates and obstacles with room to fly
    bounds: tuple[Span, Span, Span] | None = None
    start: StartEntry
    gates: Annotated[tuple[GateEntry, ...], Meta(min_length=1)]
    obstacles: tuple[ObstacleEntry, ...] = ()
    published: tuple[Published, ...] = ()


def course_names() -> tuple[str, ...]:
    """The courses that come with the project."""
    return names(COURSES)


def load_course(name_or_path: str | Path) -> Course:
    """A course by name ("split_s_swift") or path ("mine.yaml"). Raises FileError."""
    path = locate(name_or_path, COURSES, "course")
    return parse_course(read_text(path), str(path))


@lru_cache(maxsize=16)  # reports and figures of a run ask for its course again and again
def parse_course(text: str, file: str) -> Course:
    """A course from its text; `file` is shown in errors and names a course without a name. Raises
    FileError."""
    document = parse(text, file)
    entry = document.fill(CourseFile)
    course = Course(
        name=entry.name or re.sub(r"[^A-Za-z0-9_-]", "_", Path(file).stem)[:64],
        source=entry.source,
        gates=tuple(_gate(g, entry) for g in entry.gates),
        start=Start(entry.start.position, radians(entry.start.yaw_deg)),
        bounds=entry.bounds or (),
        loop=entry.loop,
        laps=entry.laps,
        published=entry.published,
        text=text,
        obstacles=tuple(_obstacles(document, entry.obstacles)),
    )
    if not entry.bounds:
        course = replace(course, bounds=_default_bounds(course))
    for path, problem in faults(course):
        raise document.error(path, problem)
    return course


def _gate(entry: GateEntry, course: CourseFile) -> Gate:
    angles = (radians(a) for a in (entry.yaw_deg, entry.pitch_deg, entry.roll_deg))
    frame_width = entry.frame_width or course.frame_width
    return Gate(
        entry.position, *angles, opening=entry.opening or course.opening, frame_width=frame_width
    )


def _obstacles(document: Document, entries: tuple[ObstacleEntry, ...]) -> Iterator[Obstacle]:
    for i, entry in enumerate(entries):
        box, cylinder = entry.box, entry.cylinder
        if (box is None) == (cylinder is None):
            got = "none of both" if box is None else "both"
            raise document.error(f"obstacles[{i}]", f"expected a box or a cylinder, got {got}")
        if box:
            yield Box(box.centre, box.size, radians(box.yaw_deg))
        if cylinder:
            yield Cylinder(cylinder.base, cylinder.radius, cylinder.height)


def _default_bounds(course: Course) -> tuple[tuple[float, float], ...]:
    points = course.points()
    (x0, y0, _), (x1, y1, z1) = (
        (points.min(axis=0) - MARGIN).tolist(),
        (points.max(axis=0) + MARGIN).tolist(),
    )
    return (x0, x1), (y0, y1), (-BELOW_GROUND, z1)
