"""Course files: their keys, units, ranges and defaults, how they become a Course, and whether all fits together."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from math import radians
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from quadsim.course.course import Course, Gate, Published, Start
from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse, unit

COURSES = Path(__file__).parents[2] / "courses"
MARGIN = 10.0  # of default bounds around start and gates [m]
BELOW_GROUND = 1.0  # of default bounds below the ground [m]: there the ground ends a flight, not the bounds
ROOM = 0.3  # around the start, and before and behind gates [m]: the largest vehicle (.25) and half a bar (.05)
ROUNDING = 1e-6  # [m]

Metre = Annotated[float, unit("m", ge=-1e4, le=1e4)]
Size = Annotated[float, unit("m", gt=0, le=100)]
Degree = Annotated[float, unit("deg", ge=-360, le=360)]
Point = tuple[Metre, Metre, Metre]
Span = tuple[Metre, Metre]
Fault = tuple[str, str]  # key in the file, problem
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
    published: tuple[Published, ...] = ()


def course_names() -> tuple[str, ...]:
    """The courses that come with the project."""
    return names(COURSES)


def load_course(name_or_path: str | Path) -> Course:
    """A course by name ("split_s_swift") or path ("mine.yaml"). Raises FileError."""
    path = locate(name_or_path, COURSES, "course")
    return parse_course(read_text(path), str(path))


def parse_course(text: str, file: str) -> Course:
    """A course from its text; `file` is shown in errors and names a course without a name. Raises FileError."""
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
    )
    if not entry.bounds:
        course = replace(course, bounds=_default_bounds(course))
    for path, problem in _faults(course):
        raise document.error(path, problem)
    return course


def _gate(entry: GateEntry, course: CourseFile) -> Gate:
    angles = (radians(a) for a in (entry.yaw_deg, entry.pitch_deg, entry.roll_deg))
    frame_width = entry.frame_width or course.frame_width
    return Gate(entry.position, *angles, opening=entry.opening or course.opening, frame_width=frame_width)


def _default_bounds(course: Course) -> tuple[tuple[float, float], ...]:
    points = course.points()
    (x0, y0, _), (x1, y1, z1) = (points.min(axis=0) - MARGIN).tolist(), (points.max(axis=0) + MARGIN).tolist()
    return (x0, x1), (y0, y1), (-BELOW_GROUND, z1)


def _faults(course: Course) -> Iterator[Fault]:
    """What no single key can show: whether gates, start, bounds and laps fit together."""
    if course.laps > 1 and not course.loop:
        yield "laps", f"expected 1 on an open course (or loop: true), got {course.laps}"
    for i, (axis, (low, high)) in enumerate(zip("xyz", course.bounds, strict=True)):
        if low >= high:
            yield f"bounds[{i}]", f"expected {axis}_min < {axis}_max [m], got [{low:g}, {high:g}]"
    yield from _start_faults(course)
    yield from _gate_faults(course)


def _start_faults(course: Course) -> Iterator[Fault]:
    start = course.start.position
    if start[2] < 0.0:
        yield "start.position", f"expected z >= 0, on or above the ground [m], got {start[2]:g}"
    if outside := _outside(course, np.array([start])):
        yield "start.position", outside
    for i, gate in enumerate(course.gates, start=1):
        if (room := gate.frame_distance(start)) < ROOM:
            yield "start.position", f"expected {ROOM} m of room, got {room:.2f} m to the frame of gate {i}"


def _gate_faults(course: Course) -> Iterator[Fault]:
    for i, gate in enumerate(course.gates):
        key, opening, centre = f"gates[{i}].position", gate.corners(), np.array(gate.position)
        before, behind = centre - ROOM * gate.rotation[:, 0], centre + ROOM * gate.rotation[:, 0]
        if (low := opening[:, 2].min()) < -ROUNDING:
            yield key, f"expected an opening above the ground, its lowest corner is at z = {low:.2f} m"
        if outside := _outside(course, opening):
            yield key, outside
        for where, point in (("before", before), ("behind", behind)):
            if point[2] < -ROUNDING:
                yield (
                    key,
                    f"expected {ROOM} m of room {where} the gate, the ground is nearer than that",
                )
            ends = point is behind and i == len(course.gates) - 1 and not course.loop
            if not ends and (outside := _outside(course, np.array([point]))):
                yield key, f"{ROOM} m {where} the gate, along its passage, is {outside}"


def _outside(course: Course, points: np.ndarray) -> str:
    """Which bound the first of the points lies beyond, or "".  points: (n, 3)"""
    for axis, values, (low, high) in zip("xyz", points.T, course.bounds, strict=True):
        for v in (values.min(), values.max()):
            if not low - ROUNDING <= v <= high + ROUNDING:
                return f"outside the bounds, expected {axis} within [{low:g}, {high:g}] [m], got {v:.2f}"
    return ""
