"""Corridor: two walls along a bent centre line, read from YAML; and the judge who ends a drive that leaves it.

At a bend the legs meet at the line that halves the angle: there one leg ends and the next one begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from quadsim.course import COURSES, Vec3
from quadsim.course_file import Metre, Size
from quadsim.files.data_files import locate, read_text
from quadsim.files.strict_yaml import parse
from quadsim.run import Event

CORRIDORS = COURSES / "corridors"
STUCK = 5.0  # [s] within a metre: the operator steps in


class CorridorFile(Struct, frozen=True, kw_only=True):
    """What a corridor file may say."""

    source: str = ""
    width: Size
    points: Annotated[tuple[tuple[Metre, Metre], ...], Meta(min_length=2)]


@dataclass(frozen=True)
class Corridor:
    name: str
    width: float  # between the walls [m]
    points: tuple[tuple[float, float], ...]  # centre line from start to goal [m]

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
        """Unit normals of the lines at which legs end: forward, at a bend halfway to the next leg.  (legs, 2)"""
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
        along = np.stack([-normal[:, 1], normal[:, 0]], axis=1)  # of the line at each point, to the left
        reach = 0.5 * self.width / (normal * e).sum(axis=1, keepdims=True)
        return np.stack([self.points + reach * along, self.points - reach * along])


def load_corridor(name_or_path: str | Path) -> Corridor:
    """By name ("zigzag") or path. Raises FileError."""
    path = locate(name_or_path, CORRIDORS, "corridor")
    document = parse(read_text(path), str(path))
    entry = document.fill(CorridorFile)
    corridor = Corridor(path.stem, entry.width, entry.points)
    if not corridor.lengths.all():
        raise document.error("points", "expected points that differ, got one twice in a row")
    bends = np.arccos(np.clip((corridor.directions[1:] * corridor.directions[:-1]).sum(axis=1), -1, 1))
    taken = 0.5 * entry.width * np.tan(bends / 2)  # of both legs, by the mitre of a bend [m]
    short = corridor.lengths < np.append(taken, 0) + np.insert(taken, 0, 0)
    if short.any():
        where = f"points[{int(np.argmax(short))}]"
        raise document.error(where, f"expected a leg longer than its bends take at width {entry.width:g} [m]")
    return corridor


class CorridorJudge:
    """Finished at the goal; crashed where the vehicle's side touches a wall; stuck; timeout."""

    lap = 1

    def __init__(self, corridor: Corridor, half_width: float, timeout: float):
        """half_width: of the vehicle [m]; timeout [s]"""
        self.outcome: str | None = None
        self.passed = 0  # legs
        self._corridor, self._timeout = corridor, timeout
        self._room = corridor.width / 2 - half_width
        self._moved = (0.0, np.array(corridor.points[0]))  # when and where it was a metre from where it was before

    @property
    def next_gate(self) -> int:
        return self.passed

    def observe(self, t0: float, p0: Vec3, t1: float, p1: Vec3, contacts: Sequence[str] = ()) -> list[Event]:
        c, p = self._corridor, np.array(p1[:2])
        if (p - c.points[self.passed + 1]) @ c.ends[self.passed] >= 0:
            self.passed += 1
        if np.linalg.norm(p - self._moved[1]) > 1.0:
            self._moved = t1, p
        if self.passed == len(c.lengths):
            self.outcome = "finished"
        elif abs(c.offset(self.passed, p)) > self._room:
            self.outcome = "crashed"
        elif t1 - self._moved[0] > STUCK:
            self.outcome = "stuck"
        elif t1 >= self._timeout:
            self.outcome = "timeout"
        return []
