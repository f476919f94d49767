"""Course: gates, obstacles, start, bounds and laps, read from a course file and written to one.

A course file has the keys of CourseFile. `parse_course` reads it, and `Course.to_yaml` writes it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import degrees, dist, inf, nextafter, radians
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np

from quadsim.course.checks import problems
from quadsim.course.course_file import (
    OF_FRAMES,
    BoxEntry,
    CourseFile,
    CylinderEntry,
    GateEntry,
    ObstacleEntry,
    Published,
    StartEntry,
    in_flown_order,
    misnumbered,
    written_entries,
)
from quadsim.course.gate import Gate, Start
from quadsim.course.obstacles import Box, Cylinder, Obstacle
from quadsim.files.strict_yaml import Document, FileError, parse
from quadsim.files.values import FieldProblem
from quadsim.files.yaml_text import dump, entries_of, remade, written

# [m] of default bounds around start, gates and obstacles
MARGIN = 10.0
# [m] of default bounds below the ground, so that the ground ends a flight and not the bounds
BELOW_GROUND = 1.0
# The key of a problem with a gate
OF_GATE = re.compile(r"gates\[(?P<index>\d+)\]")
# Keys with whose change a course loses its published times
DECIDE_TIMES = (
    "gates",
    "order",
    "opening",
    "frame_width",
    "frame_depth",
    "obstacles",
    "start",
    "loop",
)


class CourseChanges(TypedDict, total=False):
    """The keys of a course file."""

    name: str
    source: str
    loop: bool
    laps: int
    opening: Sequence[float]
    frame_width: float
    frame_depth: float
    bounds: Sequence[Sequence[float]] | None
    start: Start | Mapping[str, Any]
    gates: Sequence[Gate | Mapping[str, Any]]
    order: Sequence[int]
    obstacles: Sequence[Obstacle | Mapping[str, Any]]
    published: Sequence[Published | Mapping[str, Any]]


@dataclass(frozen=True)
class Course:
    """Gates to pass in order, from a standing start, and obstacles to keep clear of.

    Examples:
        >>> import quadsim
        >>> course = quadsim.load_course("figure8")
        >>> course.loop, round(course.lap_length, 1)
        (True, 74.4)
        >>> course.gates[0].position
        (0.0, 0.0, 1.5)
    """

    name: str
    source: str
    gates: tuple[Gate, ...]
    start: Start
    # ((x_min, x_max), (y_min, y_max), (z_min, z_max)) [m]
    bounds: tuple[tuple[float, float], ...]
    # whether the first gate comes after the last; a lap ends at the last gate
    loop: bool
    laps: int
    published: tuple[Published, ...]
    # the YAML it came from, kept with every run
    text: str
    # numbered from 1
    obstacles: tuple[Obstacle, ...] = ()

    def __repr__(self) -> str:
        """Return one short line; `to_yaml` has all numbers."""
        parts = [_counted(len(self.gates), "gate")]
        if self.obstacles:
            parts.append(_counted(len(self.obstacles), "obstacle"))
        parts.append(_counted(self.laps, "lap") if self.loop else "open")
        return f"<Course {self.name}: {', '.join(parts)}>"

    @cached_property
    def lap_length(self) -> float:
        """The length of straight lines through the gates once [m].

        On a loop the line returns to the first gate; on an open course it begins at the start.
        """
        centres = [gate.position for gate in self.gates]
        before = [centres[-1] if self.loop else self.start.position, *centres[:-1]]
        return sum(dist(a, b) for a, b in zip(before, centres, strict=True))

    def but(self, **changes: Unpack[CourseChanges]) -> Course:
        """Return the course with other gates, obstacles or laps, checked as a course file is.

        Default bounds are computed anew. Published times are dropped if gates or obstacles change,
        because they were flown on the old ones.

        Args:
            changes: keys of a course file, see docs/courses.md. `gates` and `obstacles` take Gate,
                Box and Cylinder objects, whose angles are in radians, or mappings as in a file.

        Raises:
            SettingError: an entry cannot be used, or the gates do not fit together (a ValueError).

        Examples:
            >>> from dataclasses import replace
            >>> import quadsim
            >>> course = quadsim.load_course("figure8")
            >>> first, *others = course.gates
            >>> raised = course.but(laps=1, gates=[replace(first, position=(0, 0, 2.5)), *others])
            >>> raised.gates[0].position, raised.laps
            ((0.0, 0.0, 2.5), 1)
        """

        return _changed(self, changes)

    def to_yaml(self, path: str | Path | None = None) -> str:
        """Return the course as a course file, which `load_course` reads to an equal course.

        If the stored text still describes the course, it is returned unchanged. Otherwise the text
        is written anew, and angles are equal up to the rounding of degrees.

        Args:
            path: a file to write; its name becomes the course's if the text has none. None writes
                nothing.

        Raises:
            SettingError: no course file describes this course (a ValueError).
            FileError: the file cannot be written.

        Examples:
            >>> import quadsim
            >>> short = quadsim.load_course("figure8").but(name="short", laps=1)
            >>> text = short.to_yaml("short.yaml")
            >>> quadsim.load_course("short.yaml").laps
            1
        """

        return written(_as_yaml(self), path)

    def points(self, frames: bool = True) -> np.ndarray:
        """Return the points that a view of the course has to show.  (n, 3)

        Args:
            frames: True: the corners of frames and obstacles; False: only the centres of the gates.
                The start is one of the points in either case.
        """
        start = np.array([self.start.position])
        if not frames:
            return np.vstack([start, *(gate.position for gate in self.gates)])
        of_gates = [gate.corners(gate.frame_width) for gate in self.gates]
        of_obstacles = [obstacle.corners() for obstacle in self.obstacles]
        return np.vstack([start, *of_gates, *of_obstacles])


# Reports and figures of a run ask for its course again and again.
@lru_cache(maxsize=16)
def parse_course(text: str, file: str) -> Course:
    """Return the course of a YAML text.

    Args:
        text: the YAML.
        file: name of the file, for errors; also the name of a course whose text has none.

    Raises:
        FileError: the text is not a course.
    """
    document = parse(text, file)
    course = _read(document)
    document.check(_at_entries(problems(course), document))
    return course


def course_errors(text: str, file: str) -> list[FileError]:
    """Return all errors of a course file; `parse_course` raises the first of them.

    If a value cannot be read, only such errors are found, and the parts are not compared.

    Args:
        text: the YAML.
        file: shown in errors.
    """
    try:
        parse_course(text, file)
    except FileError as error:
        return [error, *error.others]
    return []


def course_entries(course: Course) -> CourseFile:
    """Return the entries of a course's file.

    Raises:
        FileError: the course's text is not a course.
    """
    return parse(course.text, f"{course.name}.yaml").fill(CourseFile)


def course_of(entries: CourseFile, name: str, text: str = "") -> Course:
    """Return the course that entries describe, even if its parts do not fit together.

    Args:
        entries: entries of a course file.
        name: the course's name.
        text: the YAML of the entries.
    """
    entries = in_flown_order(entries)
    course = Course(
        name=name,
        source=entries.source,
        gates=tuple(_gate(gate, entries) for gate in entries.gates),
        start=Start(entries.start.position, radians(entries.start.yaw_deg)),
        bounds=entries.bounds or (),
        loop=entries.loop,
        laps=entries.laps,
        published=entries.published,
        text=text,
        obstacles=tuple(_obstacle(obstacle) for obstacle in entries.obstacles),
    )
    if not entries.bounds:
        course = replace(course, bounds=_default_bounds(course))
    return course


def summary(course: Course) -> str:
    """Return a short description of a course, such as "7 gates, 75.0 m, loop, 3 laps"."""
    parts = [_counted(len(course.gates), "gate")]
    if course.obstacles:
        parts.append(_counted(len(course.obstacles), "obstacle"))
    parts.append(f"{course.lap_length:.1f} m")
    parts.append(f"loop, {_counted(course.laps, 'lap')}" if course.loop else "open")
    return ", ".join(parts)


def _counted(count: int, what: str) -> str:
    """Return a count with its noun, such as "1 lap" or "3 laps"."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _read(document: Document) -> Course:
    """Return the course of a file, whether its parts fit together or not. Raises FileError."""
    entries = document.fill(CourseFile)
    for i, entry in enumerate(entries.obstacles):
        if (entry.box is None) == (entry.cylinder is None):
            got = "neither" if entry.box is None else "both"
            raise document.error(f"obstacles[{i}]", f"expected a box or a cylinder, got {got}")
    wrong = misnumbered(entries)
    if wrong is not None:
        index, problem = wrong
        raise document.error(f"order[{index}]", problem)
    own_name = re.sub(r"[^A-Za-z0-9_-]", "_", Path(document.file).stem)[:64]
    return course_of(entries, entries.name or own_name, document.text)


def _at_entries(found: Iterator[FieldProblem], document: Document) -> Iterator[FieldProblem]:
    """Yield the problems of a course with the keys of its file at which they occur.

    Args:
        found: problems, in which gates are numbered in the order of flight.
        document: the file.
    """
    order = document.fill(CourseFile).order
    for key, problem in found:
        gate = OF_GATE.match(key)
        if gate and order:
            index = abs(order[int(gate["index"])]) - 1
            key = f"gates[{index}]{key[gate.end() :]}"
        yield FieldProblem(key, problem)


def is_described(course: Course) -> bool:
    """Return whether a course still equals the course that its text describes."""
    try:
        return parse_course(course.text, course.name) == course
    except FileError:
        return False


def _as_yaml(course: Course) -> str:
    """Return the course as a course file; see Course.to_yaml.

    Raises:
        SettingError: no course file describes it.
    """
    if is_described(course):
        return course.text
    entries = written_entries(_file(course))
    remade(entries, parse_course, course.name)
    return dump(entries)


def _changed(course: Course, changes: Mapping[str, Any]) -> Course:
    """Return the course with other values of some keys of its file; see Course.but.

    Raises:
        SettingError: a value cannot be used.
    """
    file = _file(course)
    entries = written_entries(file)
    if any(key in changes for key in DECIDE_TIMES):
        entries.pop("published", None)
    # The entry of a given gate leaves out an opening or frame that equals the course's
    defaults = {name: changes.get(name, getattr(file, name)) for name in OF_FRAMES}
    given = {key: _as_entry(key, value, entries, defaults) for key, value in changes.items()}
    return remade({**entries, **given}, parse_course, str(given.get("name", course.name)))


def _as_entry(key: str, value: Any, entries: Mapping[str, Any], defaults: Mapping[str, Any]) -> Any:
    """Return a changed value in the form that a course file has.

    Args:
        key: key of the value.
        value: entries of a file, or objects of a Course.
        entries: the entries of the course that is changed.
        defaults: opening and frame of the changed course.
    """
    match key, value:
        case "start", Mapping():
            return {**entries["start"], **value}
        case "start", Start():
            return entries_of(_start_entry(value))
        case (("gates" | "obstacles" | "published"), list() | tuple()):
            return [_item_entry(item, defaults) for item in value]
    return value


def _item_entry(item: Any, defaults: Mapping[str, Any]) -> Any:
    """Return the entry of a gate, obstacle or published time, and any other value unchanged."""
    match item:
        case Gate():
            same = [key for key in OF_FRAMES if np.array_equal(getattr(item, key), defaults[key])]
            return entries_of(replace(_gate_entry(item), **dict.fromkeys(same)))
        case Box() | Cylinder():
            return entries_of(_obstacle_entry(item))
        case Published():
            return entries_of(item)
    return item


def _file(course: Course) -> CourseFile:
    """Return the entries of a course's file; most gates decide its default opening and frame."""
    of_most = {
        name: Counter(getattr(gate, name) for gate in course.gates).most_common(1)[0][0]
        for name in OF_FRAMES
    }
    x, y, z = course.bounds
    return CourseFile(
        name=course.name,
        source=course.source,
        loop=course.loop,
        laps=course.laps,
        **of_most,
        bounds=None if course.bounds == _default_bounds(course) else (x, y, z),
        start=_start_entry(course.start),
        gates=tuple(map(_gate_entry, course.gates)),
        obstacles=tuple(map(_obstacle_entry, course.obstacles)),
        published=course.published,
    )


def _start_entry(start: Start) -> StartEntry:
    return StartEntry(position=start.position, yaw_deg=in_degrees(start.yaw))


def _gate_entry(gate: Gate) -> GateEntry:
    """Return the entry of a gate, with its own opening and frame."""
    return GateEntry(
        position=gate.position,
        yaw_deg=in_degrees(gate.yaw),
        pitch_deg=in_degrees(gate.pitch),
        roll_deg=in_degrees(gate.roll),
        opening=gate.opening,
        frame_width=gate.frame_width,
        frame_depth=gate.frame_depth,
    )


def _obstacle_entry(obstacle: Obstacle) -> ObstacleEntry:
    """Return the entry of an obstacle."""
    if isinstance(obstacle, Cylinder):
        pole = CylinderEntry(base=obstacle.base, radius=obstacle.radius, height=obstacle.height)
        return ObstacleEntry(cylinder=pole)
    yaw = in_degrees(obstacle.yaw)
    return ObstacleEntry(box=BoxEntry(centre=obstacle.centre, size=obstacle.size, yaw_deg=yaw))


def in_degrees(angle: float) -> float:
    """Return an angle [rad] as the shortest number of degrees that converts back exactly.

    Most angles that were not read in degrees have no such number; then the nearest is returned.
    """
    nearest = degrees(angle)
    rounded = (round(nearest, digits) for digits in range(16))
    beside = (nearest, nextafter(nearest, -inf), nextafter(nearest, inf))
    return next((each for each in (*rounded, *beside) if radians(each) == angle), nearest)


def _gate(entry: GateEntry, course: CourseFile) -> Gate:
    """Return a gate, with the course's opening or frame if its entry has none."""
    return Gate(
        position=entry.position,
        yaw=radians(entry.yaw_deg),
        pitch=radians(entry.pitch_deg),
        roll=radians(entry.roll_deg),
        opening=entry.opening or course.opening,
        frame_width=entry.frame_width or course.frame_width,
        frame_depth=entry.frame_depth or course.frame_depth,
    )


def _obstacle(entry: ObstacleEntry) -> Obstacle:
    """Return an obstacle of an entry that has a box or a cylinder."""
    if entry.box:
        return Box(entry.box.centre, entry.box.size, radians(entry.box.yaw_deg))
    pole = entry.cylinder
    if pole is None:
        raise ValueError("expected a box or a cylinder, got neither")
    return Cylinder(pole.base, pole.radius, pole.height)


def _default_bounds(course: Course) -> tuple[tuple[float, float], ...]:
    """Return bounds with MARGIN around start, gates and obstacles."""
    points = course.points()
    x0, y0, _ = (points.min(axis=0) - MARGIN).tolist()
    x1, y1, z1 = (points.max(axis=0) + MARGIN).tolist()
    return (x0, x1), (y0, y1), (-BELOW_GROUND, z1)
