"""Course: gates, obstacles, start, bounds and laps as plain values; see course_file for the YAML
they are read from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import cached_property
from math import dist
from typing import Annotated

import numpy as np

from quadsim.course.obstacles import Obstacle
from quadsim.course.opening import (
    Bar,
    InGate,
    distance_to_frame,
    frame_bars,
    outer_half_sizes,
    rectangle_corners,
)
from quadsim.files.strict_yaml import unit
from quadsim.rotation import Vec3, euler_matrix, in_frame

Second = Annotated[float, unit("s", gt=0)]


@dataclass(frozen=True)
class Gate:
    """A rectangular opening in a flat frame. Gate frame: x along the legal passage, y left, z up.

    Sizes, planes and sides of the opening are computed in quadsim.course.opening.
    """

    position: Vec3  # centre of the opening, ENU [m]
    yaw: float  # [rad]
    pitch: float  # [rad], positive turns the passage down
    roll: float  # [rad]
    opening: tuple[float, float]  # width (y), height (z) [m]
    frame_width: float  # of the bars around the opening [m]

    @cached_property
    def rotation(self) -> np.ndarray:
        """World from gate. Columns: passage, left, up.  (3, 3)"""
        return euler_matrix(self.yaw, self.pitch, self.roll)

    @cached_property
    def axes(self) -> tuple[Vec3, Vec3, Vec3]:
        """Passage, left and up in the world, as plain floats."""
        passage, left, up = self.rotation.T.tolist()
        return tuple(passage), tuple(left), tuple(up)

    def to_local(self, p: Vec3) -> InGate:
        """Return a point of the world in the gate frame [m]."""
        c = self.position
        return InGate(*in_frame((p[0] - c[0], p[1] - c[1], p[2] - c[2]), *self.axes))

    def to_local_rows(self, points: np.ndarray) -> InGate:
        """Return points (n, 3) of the world in the gate frame, as an InGate of three arrays (n,)
        [m]."""
        away = points - self.position
        return InGate(*(away @ self.rotation).T)

    def to_world(self, p: InGate) -> Vec3:
        """Return a point of the gate frame in the world [m]."""
        x, y, z = (self.position + self.rotation @ p).tolist()
        return x, y, z

    @property
    def bars(self) -> tuple[Bar, Bar, Bar, Bar]:
        """The four bars of the frame, in the gate frame."""
        return frame_bars(self.opening, self.frame_width)

    def corners(self, border: float = 0.0) -> np.ndarray:
        """Return the corners of the opening, `border` [m] farther out, in the world.  (4, 3)"""
        local = rectangle_corners(outer_half_sizes(self.opening, border))
        return self.position + local @ self.rotation.T

    def frame_distance(self, point: Vec3) -> float:
        """Return the distance from a point of the world to the nearest bar, taken as flat; 0 on a
        bar [m]."""
        return distance_to_frame(self.to_local(point), self.opening, self.frame_width)


@dataclass(frozen=True)
class EstimatedGate(Gate):
    """A gate at its estimated position, with the uncertainty of that."""

    # standard deviation of the position relative to the vehicle, the largest of x, y and z [m]
    std: float = 0.0

    @classmethod
    def of(cls, gate: Gate, moved: Vec3, std: float) -> EstimatedGate:
        """The gate of the map, displaced by `moved` [m]."""
        where = {f.name: getattr(gate, f.name) for f in fields(gate)}
        return cls(
            **where
            | {
                "position": tuple(a + b for a, b in zip(gate.position, moved, strict=True)),
                "std": std,
            }
        )


@dataclass(frozen=True)
class Start:
    """Where a flight begins, at rest."""

    position: Vec3  # [m]
    yaw: float  # [rad]


@dataclass(frozen=True)
class Published:
    """A time on these gates that others have published."""

    who: str
    time: Second


@dataclass(frozen=True)
class Course:
    """Gates to pass in order, from a standing start, and obstacles to keep clear of."""

    name: str
    source: str
    gates: tuple[Gate, ...]
    start: Start
    bounds: tuple[tuple[float, float], ...]  # ((x_min, x_max), (y_min, y_max), (z_min, z_max)) [m]
    loop: bool  # after the last gate comes the first; a lap ends at the last gate
    laps: int
    published: tuple[Published, ...]
    text: str  # the YAML it came from, kept with every run
    obstacles: tuple[Obstacle, ...] = ()  # what else stands there; numbered from 1

    @cached_property
    def lap_length(self) -> float:
        """Straight-line length through the gates once, from the start (open) or closed (loop)
        [m]."""
        p = [g.position for g in self.gates]
        before = [p[-1] if self.loop else self.start.position, *p[:-1]]
        return sum(dist(a, b) for a, b in zip(before, p, strict=True))

    def points(self, frames: bool = True) -> np.ndarray:
        """The start and all gates' centres; or the start, the frames' corners and the obstacles':
        what a view has to show.  (n, 3)"""
        if not frames:
            return np.array([self.start.position, *(g.position for g in self.gates)])
        corners: Iterable = (
            *(g.corners(g.frame_width) for g in self.gates),
            *(o.corners() for o in self.obstacles),
        )
        return np.vstack([[self.start.position], *corners])
