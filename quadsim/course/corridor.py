"""Corridor: two walls along a bent centre line, read from YAML.

At a bend the legs meet at the line that halves the angle: there one leg ends and the next one
begins.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from quadsim.course.course_file import COURSES, Metre, Size
from quadsim.files.data_files import locate, read_text
from quadsim.files.strict_yaml import parse

CORRIDORS = COURSES / "corridors"


@dataclass(frozen=True, kw_only=True)
class CorridorFile:
    """What a corridor file may say."""

    source: str = ""
    width: Size  # between the walls
    points: Annotated[
        tuple[tuple[Metre, Metre], ...], Meta(min_length=2)
    ]  # centre line from start to goal


@dataclass(frozen=True, kw_only=True)
class Corridor(CorridorFile):
    name: str
    text: str = ""  # the YAML it came from, kept with every run

    laps = 1

    @cached_property
    def directions(self) -> np.ndarray:
        """Unit vectors along the legs.  (legs, 2)"""
        legs = np.diff(np.array(self.points), axis=0)
        return legs / np.linalg.norm(legs, axis=1, keepdims=True)

    @cached_property
    def lengths(self) -> np.ndarray:
        """Of the legs [m].  (legs,)"""
        return np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)

    @cached_property
    def ends(self) -> np.ndarray:
        """Unit normals of the lines at which legs end: forward, at a bend halfway to the next leg.
        (legs, 2)"""
        e = self.directions
        both = e + np.vstack([e[1:], e[-1:]])
        return both / np.linalg.norm(both, axis=1, keepdims=True)

    def offset(self, leg: int, p: np.ndarray) -> float:
        """Of a point from the centre line of a leg, positive to the left [m].  p (2,)"""
        (ex, ey), (dx, dy) = self.directions[leg], p - self.points[leg + 1]
        return float(ex * dy - ey * dx)

    def walls(self) -> np.ndarray:
        """Left and right wall as polylines, mitred.  (2, points, 2)"""
        e = np.vstack([self.directions[:1], self.directions])
        normal = np.vstack([self.directions[:1], self.ends])
        # of the line at each point, to the left
        along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
        reach = 0.5 * self.width / (normal * e).sum(axis=1, keepdims=True)
        return np.stack([self.points + reach * along, self.points - reach * along])


def load_corridor(name_or_path: str | Path) -> Corridor:
    """By name ("zigzag") or path. Raises FileError."""
    path = locate(name_or_path, CORRIDORS, "course")
    return parse_corridor(read_text(path), str(path))


def parse_corridor(text: str, file: str) -> Corridor:
    """From its text; `file` is shown in errors and gives the name. Raises FileError."""
    document = parse(text, file)
    entry = document.fill(CorridorFile)
    corridor = Corridor(name=Path(file).stem, text=text, **vars(entry))
    if not corridor.lengths.all():
        raise document.error("points", "expected points that differ, got one twice in a row")
    bends = np.arccos(
        np.clip((corridor.directions[1:] * corridor.directions[:-1]).sum(axis=1), -1, 1)
    )
    taken = 0.5 * entry.width * np.tan(bends / 2)  # of both legs, by the mitre of a bend [m]
    short = corridor.lengths < np.append(taken, 0) + np.insert(taken, 0, 0)
    if short.any():
        where = f"points[{int(np.argmax(short))}]"
        raise document.error(
            where, f"expected a leg longer than its bends take at width {entry.width:g} [m]"
        )
    return corridor
