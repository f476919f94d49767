"""Course files: their keys with units, ranges and defaults, and how they become a Course."""

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
from quadsim.files.strict_yaml import Document, parse, setting, unit

COURSES = Path(__file__).parents[2] / "courses"
# [m] of default bounds around start, gates and obstacles
MARGIN = 10.0
# [m] of default bounds below the ground, so that the ground ends a flight and not the bounds
BELOW_GROUND = 1.0

Metre = Annotated[float, unit("m", ge=-1e4, le=1e4)]
Size = Annotated[float, unit("m", gt=0, le=100)]
Degree = Annotated[float, unit("deg", ge=-360, le=360)]
Point = tuple[Metre, Metre, Metre]
Span = tuple[Metre, Metre]
# Folders of runs have the name of their course.
Name = Annotated[str, Meta(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]


class GateEntry(Struct, frozen=True, kw_only=True):
    """A gate of a course file."""

    position: Annotated[Point, setting("centre of the opening")]
    yaw_deg: Annotated[Degree, setting("direction of the passage")]
    pitch_deg: Annotated[Degree, setting("pitch of the passage, positive down")] = 0.0
    roll_deg: Annotated[Degree, setting("roll about the passage")] = 0.0
    opening: Annotated[
        tuple[Size, Size] | None, setting("width and height; default: the course's")
    ] = None
    frame_width: Annotated[
        Size | None, setting("width of the bars around the opening; default: the course's")
    ] = None


class StartEntry(Struct, frozen=True, kw_only=True):
    """The start of a course file."""

    position: Annotated[Point, setting("position at rest")]
    yaw_deg: Annotated[Degree, setting("heading")]


class BoxEntry(Struct, frozen=True, kw_only=True):
    """A box of a course file."""

    centre: Annotated[Point, setting("centre of the box")]
    size: Annotated[tuple[Size, Size, Size], setting("size along the box's own x, y and z")]
    yaw_deg: Annotated[Degree, setting("direction of the box's x axis")] = 0.0


class CylinderEntry(Struct, frozen=True, kw_only=True):
    """An upright cylinder of a course file."""

    base: Annotated[Point, setting("centre of the lower end")]
    radius: Annotated[Size, setting("radius")]
    height: Annotated[Size, setting("height")]


class ObstacleEntry(Struct, frozen=True, kw_only=True):
    """An obstacle of a course file: a box or a cylinder."""

    box: BoxEntry | None = None
    cylinder: CylinderEntry | None = None


class CourseFile(Struct, frozen=True, kw_only=True):
    """The keys of a course file."""

    name: Annotated[Name | None, setting("name of the course; default: the file's")] = None
    source: Annotated[str, setting("origin of the course")] = ""
    loop: Annotated[bool, setting("whether the first gate comes after the last")] = False
    laps: Annotated[int, setting("laps of a race", ge=1, le=1000)] = 1
    opening: Annotated[tuple[Size, Size], setting("width and height of gates' openings")]
    # Swift's gates have openings of 1.5 m in a frame of 2.05 m.
    frame_width: Annotated[Size, setting("width of the bars around an opening")] = 0.275
    bounds: Annotated[
        tuple[Span, Span, Span] | None,
        setting("spans of x, y and z; default: around start, gates and obstacles, with room"),
    ] = None
    start: StartEntry
    gates: Annotated[tuple[GateEntry, ...], Meta(min_length=1)]
    obstacles: tuple[ObstacleEntry, ...] = ()
    published: tuple[Published, ...] = ()


def course_names() -> tuple[str, ...]:
    """Return the names of the courses that come with the project."""
    return names(COURSES)


def load_course(name_or_path: str | Path) -> Course:
    """Return a course by name ("split_s_swift") or path ("mine.yaml").

    Raises:
        FileError: there is no such course, or the file is not a course.

    Examples:
        >>> import quadsim
        >>> course = quadsim.load_course("split_s_swift")
        >>> len(course.gates), course.laps
        (7, 3)
    """
    path = locate(name_or_path, COURSES, "course")
    return parse_course(read_text(path), str(path))


# Reports and figures of a run ask for its course again and again.
@lru_cache(maxsize=16)
def parse_course(text: str, file: str) -> Course:
    """Return the course of a YAML text.

    Args:
        text: the YAML.
        file: shown in errors; names a course without a name.

    Raises:
        FileError: the text is not a course.
    """
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
    """Return a gate; what its entry leaves out is the course's."""
    return Gate(
        position=entry.position,
        yaw=radians(entry.yaw_deg),
        pitch=radians(entry.pitch_deg),
        roll=radians(entry.roll_deg),
        opening=entry.opening or course.opening,
        frame_width=entry.frame_width or course.frame_width,
    )


def _obstacles(document: Document, entries: tuple[ObstacleEntry, ...]) -> Iterator[Obstacle]:
    """Yield the obstacles. Raises FileError for an entry that is not one of both kinds."""
    for i, entry in enumerate(entries):
        box = entry.box
        cylinder = entry.cylinder
        if (box is None) == (cylinder is None):
            got = "neither" if box is None else "both"
            raise document.error(f"obstacles[{i}]", f"expected a box or a cylinder, got {got}")
        if box:
            yield Box(box.centre, box.size, radians(box.yaw_deg))
        if cylinder:
            yield Cylinder(cylinder.base, cylinder.radius, cylinder.height)


def _default_bounds(course: Course) -> tuple[tuple[float, float], ...]:
    """Return bounds with MARGIN around start, gates and obstacles."""
    points = course.points()
    x0, y0, _ = (points.min(axis=0) - MARGIN).tolist()
    x1, y1, z1 = (points.max(axis=0) + MARGIN).tolist()
    return (x0, x1), (y0, y1), (-BELOW_GROUND, z1)
