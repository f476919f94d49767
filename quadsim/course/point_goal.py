"""A point to reach from a point, for systems without gates: the task of the paper's double
integrator, as YAML."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from quadsim.course.course import Second
from quadsim.course.course_file import COURSES, Metre
from quadsim.files.data_files import locate, read_text
from quadsim.files.strict_yaml import parse

GOALS = COURSES / "goals"


@dataclass(frozen=True, kw_only=True)
class PointGoalFile:
    """What a goal file may say."""

    source: str = ""
    start: tuple[Metre, Metre]
    velocity: tuple[float, float] = (0.0, 0.0)  # at the start [m/s]
    goal: tuple[Metre, Metre]
    duration: Second


@dataclass(frozen=True, kw_only=True)
class PointGoal(PointGoalFile):
    """From a state to a point in the plane; the flight ends after `duration`."""

    name: str
    text: str = ""  # the YAML it came from, kept with every run

    laps = 1


def load_point_goal(name_or_path: str | Path) -> PointGoal:
    """By name ("table2") or path. Raises FileError."""
    path = locate(name_or_path, GOALS, "course")
    return parse_point_goal(read_text(path), str(path))


def parse_point_goal(text: str, file: str) -> PointGoal:
    """From its text; `file` is shown in errors and gives the name. Raises FileError."""
    entry = parse(text, file).fill(PointGoalFile)
    return PointGoal(name=Path(file).stem, text=text, **vars(entry))
