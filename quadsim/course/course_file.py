"""Course files: their keys with units, ranges and defaults, and how they become a Course."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from math import degrees, inf, nextafter, radians
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta, Struct

from quadsim.course.checks import faults
from quadsim.course.course import Course, Gate, Published, Start
from quadsim.course.obstacles import Box, Cylinder, Obstacle
from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import Document, FileError, parse, setting, unit
from quadsim.files.yaml_text import dump, remade

COURSES = Path(__file__).parents[2] / "courses"
# [m] of default bounds around start, gates and obstacles
MARGIN = 10.0
# [m] of default bounds below the ground, so that the ground ends a flight and not the bounds
BELOW_GROUND = 1.0
# Keys whose change makes published times those of another course
DECIDE_TIMES = ("gates", "opening", "frame_width", "obstacles", "start", "loop")

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
    start: Annotated[StartEntry, setting("place and heading at rest")]
    gates: Annotated[tuple[GateEntry, ...], setting("gates in the order of flight", min_length=1)]
    obstacles: Annotated[
        tuple[ObstacleEntry, ...], setting("boxes and cylinders to keep clear of")
    ] = ()
    published: Annotated[
        tuple[Published, ...], setting("times that reports show beside yours")
    ] = ()


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


def is_described(course: Course) -> bool:
    """Return whether a course is the one that its text describes."""
    try:
        return parse_course(course.text, course.name) == course
    except FileError:
        return False


def as_yaml(course: Course) -> str:
    """Return the course as a course file; see Course.to_yaml.

    Raises:
        SettingError: no course file describes it.
    """
    if is_described(course):
        return course.text
    entries = _entries(course)
    remade(entries, parse_course, course.name)
    return dump(entries)


def changed(course: Course, changes: Mapping[str, Any]) -> Course:
    """Return the course with other values of some keys of its file; see Course.but.

    Raises:
        SettingError: a value cannot be used.
    """
    entries = _entries(course)
    if any(key in changes for key in DECIDE_TIMES):
        entries.pop("published", None)
    given = {key: _as_entry(key, value, entries) for key, value in changes.items()}
    return remade({**entries, **given}, parse_course, str(given.get("name", course.name)))


def _as_entry(key: str, value: Any, entries: Mapping[str, Any]) -> Any:
    """Return a changed value as a course file has it.

    Args:
        key: its key.
        value: entries of a file, or objects of a Course.
        entries: the entries of the course that is changed.
    """
    match key, value:
        case "start", Mapping():
            return {**entries["start"], **value}
        case "start", Start():
            return _start_entry(value)
        case (("gates" | "obstacles" | "published"), list() | tuple()):
            defaults = {name: entries.get(name) for name in ("opening", "frame_width")}
            return [_item_entry(item, defaults) for item in value]
    return value


def _item_entry(item: Any, defaults: Mapping[str, Any]) -> Any:
    """Return the entry of a gate, an obstacle or a published time; another value as it is."""
    match item:
        case Gate():
            return _gate_entry(item, defaults)
        case Box() | Cylinder():
            return _obstacle_entry(item)
        case Published():
            return {"who": item.who, "time": item.time}
    return item


def _entries(course: Course) -> dict[str, Any]:
    """Return the entries of a course file; most of those at their default are left out."""
    # The opening and the frame that most gates have
    opening = Counter(gate.opening for gate in course.gates).most_common(1)[0][0]
    frame_width = Counter(gate.frame_width for gate in course.gates).most_common(1)[0][0]
    defaults = {"opening": opening, "frame_width": frame_width}
    has_own_bounds = course.bounds != _default_bounds(course)
    optional = {
        "bounds": course.bounds if has_own_bounds else None,
        "obstacles": [_obstacle_entry(obstacle) for obstacle in course.obstacles],
        "published": [_item_entry(published, defaults) for published in course.published],
    }
    entries: dict[str, Any] = {
        "name": course.name,
        "source": course.source,
        "loop": course.loop,
        "laps": course.laps,
        **defaults,
        "start": _start_entry(course.start),
        "gates": [_gate_entry(gate, defaults) for gate in course.gates],
    }
    return entries | {key: value for key, value in optional.items() if value}


def _start_entry(start: Start) -> dict[str, Any]:
    return {"position": start.position, "yaw_deg": in_degrees(start.yaw)}


def _gate_entry(gate: Gate, defaults: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entry of a gate; openings and frames that are the course's are left out."""
    entry: dict[str, Any] = {"position": gate.position, "yaw_deg": in_degrees(gate.yaw)}
    if gate.pitch:
        entry["pitch_deg"] = in_degrees(gate.pitch)
    if gate.roll:
        entry["roll_deg"] = in_degrees(gate.roll)
    own = {name: getattr(gate, name) for name in ("opening", "frame_width")}
    return entry | {name: value for name, value in own.items() if value != defaults[name]}


def _obstacle_entry(obstacle: Obstacle) -> dict[str, Any]:
    """Return the entry of an obstacle."""
    if isinstance(obstacle, Cylinder):
        values = {"base": obstacle.base, "radius": obstacle.radius, "height": obstacle.height}
        return {"cylinder": values}
    yaw = in_degrees(obstacle.yaw)
    return {"box": {"centre": obstacle.centre, "size": obstacle.size, "yaw_deg": yaw}}


def in_degrees(angle: float) -> float:
    """Return an angle [rad] in degrees, the shortest number that gives it to the last bit.

    Where none does, as for most angles that were not read in degrees, it is the nearest.
    """
    nearest = degrees(angle)
    rounded = (round(nearest, digits) for digits in range(16))
    beside = (nearest, nextafter(nearest, -inf), nextafter(nearest, inf))
    return next((each for each in (*rounded, *beside) if radians(each) == angle), nearest)


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
