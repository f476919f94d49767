"""Obstacles beside the gates: boxes turned about the vertical, and upright cylinders."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import cos, hypot, pi, sin

import numpy as np

from quadsim.rotation import Vec3, in_frame

UP: Vec3 = (0.0, 0.0, 1.0)
# corners of the outline of a cylinder
ROUND = 24


@dataclass(frozen=True)
class Box:
    """A box at any height, turned about the vertical."""

    # [m]
    centre: Vec3
    # along its own x, y and z [m]
    size: Vec3
    # direction of its x axis [rad]
    yaw: float = 0.0

    @cached_property
    def axes(self) -> tuple[Vec3, Vec3, Vec3]:
        """The box's x, y and z axes in the world."""
        c = cos(self.yaw)
        s = sin(self.yaw)
        return (c, s, 0.0), (-s, c, 0.0), UP

    @cached_property
    def half(self) -> Vec3:
        """The half of the box's size [m]."""
        x, y, z = self.size
        return x / 2, y / 2, z / 2

    @property
    def position(self) -> Vec3:
        """The position of the centre [m], named as for a gate."""
        return self.centre

    @property
    def top(self) -> float:
        """The height of the box's upper face [m]."""
        return self.centre[2] + self.half[2]

    def to_local(self, p: Vec3) -> Vec3:
        """Return a point of the world in the axes of the box, from its centre [m]."""
        c = self.centre
        return in_frame((p[0] - c[0], p[1] - c[1], p[2] - c[2]), *self.axes)

    def distance(self, point: Vec3) -> float:
        """Return the distance from a point to the surface, 0 inside [m]."""
        local = self.to_local(point)
        return hypot(*(max(abs(d) - h, 0.0) for d, h in zip(local, self.half, strict=True)))

    def outline(self, border: float = 0.0) -> np.ndarray:
        """Return x and y [m] of the corners in turn, each side `border` [m] farther out.  (4, 2)"""
        x, y, _ = self.half
        turn = np.array(self.axes)[:2, :2]
        signs = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
        return signs * (x + border, y + border) @ turn + self.centre[:2]

    def corners(self) -> np.ndarray:
        """Return the corners of the box [m].  (8, 3)"""
        return _corners(self.outline(), self.centre[2] - self.half[2], self.top)


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder, such as a pole."""

    # centre of its lower end [m]
    base: Vec3
    # [m]
    radius: float
    # [m]
    height: float

    @property
    def top(self) -> float:
        """The height of the cylinder's upper end [m]."""
        return self.base[2] + self.height

    @property
    def centre(self) -> Vec3:
        """The position of the cylinder's centre [m]."""
        x, y, z = self.base
        return x, y, z + self.height / 2

    def distance(self, point: Vec3) -> float:
        """Return the distance from a point to the surface, 0 inside [m]."""
        x, y, z = self.base
        beside = hypot(point[0] - x, point[1] - y) - self.radius
        return hypot(max(beside, 0.0), max(z - point[2], point[2] - self.top, 0.0))

    def outline(self, border: float = 0.0) -> np.ndarray:
        """Return x and y [m] of points around the cylinder, counterclockwise.  (ROUND, 2)

        Args:
            border: distance of the points from the cylinder's side [m].
        """
        turn = 2.0 * pi * np.arange(ROUND) / ROUND
        circle = np.column_stack([np.cos(turn), np.sin(turn)])
        return (self.radius + border) * circle + self.base[:2]

    def corners(self) -> np.ndarray:
        """Return the corners of the upright box around the cylinder [m].  (8, 3)"""
        r = self.radius
        around = np.array(list(product((-r, r), repeat=2))) + self.base[:2]
        return _corners(around, self.base[2], self.top)


Obstacle = Box | Cylinder


def _corners(outline: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return the points of an outline (n, 2) at two heights [m].  (2 n, 3)"""
    below = np.column_stack([outline, np.full(len(outline), low)])
    above = np.column_stack([outline, np.full(len(outline), high)])
    return np.vstack([below, above])
