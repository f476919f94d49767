"""Course: gates, start, bounds and laps, read from YAML with errors that name file, line, key and unit."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from math import dist, radians
from pathlib import Path

import numpy as np

from quadsim.course_checks import corners, faults
from quadsim.course_file import CourseFile, GateEntry
from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse

COURSES = Path(__file__).parent.parent / "courses"
ROOM = 10.0  # of default bounds around start and gates [m]
BASEMENT = 1.0  # of default bounds below the ground, which is judged by itself [m]

Vec3 = tuple[float, float, float]


@dataclass(frozen=True)
class Gate:
    """A rectangular opening in a flat frame. Gate frame: x along the legal passage, y left, z up."""

    position: Vec3  # centre of the opening, ENU [m]
    yaw: float  # [rad]
    pitch: float  # [rad], positive turns the passage down
    roll: float  # [rad]
    opening: tuple[float, float]  # width (y), height (z) [m]
    frame_width: float  # of the bars around the opening [m]

    @cached_property
    def rotation(self) -> np.ndarray:
        """World from gate, R = Rz(yaw) Ry(pitch) Rx(roll). Columns: passage, left, up.  (3, 3)"""
        cy, sy, cp, sp, cr, sr = (f(a) for a in (self.yaw, self.pitch, self.roll) for f in (np.cos, np.sin))
        return np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )


@dataclass(frozen=True)
class Start:
    position: Vec3  # [m]
    yaw: float  # [rad]


@dataclass(frozen=True)
class Published:
    """A time somebody else flew on these gates, to hold ours against."""

    who: str
    time: float  # [s]


@dataclass(frozen=True)
class Course:
    name: str
    source: str
    gates: tuple[Gate, ...]
    start: Start
    bounds: tuple[tuple[float, float], ...]  # ((x_min, x_max), (y_min, y_max), (z_min, z_max)) [m]
    loop: bool  # after the last gate comes the first; a lap ends at the last gate
    laps: int
    published: tuple[Published, ...]
    text: str  # the YAML it came from, kept with every run

    @cached_property
    def lap_length(self) -> float:
        """Straight-line length through the gates once, from the start (open) or closed (loop) [m]."""
        p = [g.position for g in self.gates]
        before = [p[-1] if self.loop else self.start.position, *p[:-1]]
        return sum(dist(a, b) for a, b in zip(before, p, strict=True))


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
    gates = tuple(_gate(g, entry) for g in entry.gates)
    start = Start(entry.start.position, radians(entry.start.yaw_deg))
    course = Course(
        name=entry.name or re.sub(r"[^A-Za-z0-9_-]", "_", Path(file).stem)[:64],
        source=entry.source,
        gates=gates,
        start=start,
        bounds=entry.bounds or _room_to_fly(gates, start),
        loop=entry.loop,
        laps=entry.laps,
        published=tuple(Published(p.who, p.time) for p in entry.published),
        text=text,
    )
    for path, problem in faults(course):
        raise document.error(path, problem)
    return course


def _gate(entry: GateEntry, course: CourseFile) -> Gate:
    angles = (radians(a) for a in (entry.yaw_deg, entry.pitch_deg, entry.roll_deg))
    frame_width = entry.frame_width or course.frame_width
    return Gate(entry.position, *angles, opening=entry.opening or course.opening, frame_width=frame_width)


def _room_to_fly(gates: tuple[Gate, ...], start: Start) -> tuple[tuple[float, float], ...]:
    points = np.vstack([[start.position], *(corners(g, border=g.frame_width) for g in gates)])  # (1 + 4 gates, 3)
    (x0, y0, _), (x1, y1, z1) = (points.min(axis=0) - ROOM).tolist(), (points.max(axis=0) + ROOM).tolist()
    return (x0, x1), (y0, y1), (-BASEMENT, z1)
