"""Course: gates, start, bounds and laps, read from YAML with errors that name file, line, key and unit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import hypot

import numpy as np

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
        legs = list(zip(p, p[1:] + p[:1], strict=True)) if self.loop else list(zip([self.start.position, *p], p, strict=False))
        return sum(hypot(*(b[i] - a[i] for i in range(3))) for a, b in legs)
