"""Obstacles beside the gates: boxes turned about the vertical, and vertical cylinders such as
poles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import cos, hypot, pi, sin

import numpy as np

from quadsim.rotation import Vec3, in_frame

UP: Vec3 = (0.0, 0.0, 1.0)
ROUND = 24  # corners of the outline of a cylinder


@dataclass(frozen=True)
class Box:
    """A box on any height, turned about the vertical."""

    centre: Vec3  # [m]
    size: Vec3  # along its own x, y and z [m]
    yaw: float = 0.0  # of its x axis [rad]

    @cached_property
    def axes(self) -> tuple[Vec3, Vec3, Vec3]:
        """Its x, y and z axes in the world."""
        c, s = cos(self.yaw), sin(self.yaw)
        return (c, s, 0.0), (-s, c, 0.0), UP

    @cached_property
    def half(self) -> Vec3:
        """Half of its size [m]."""
        x, y, z = self.size
        return x / 2, y / 2, z / 2

    @property
    def position(self) -> Vec3:
        """Of its centre, by the name that a gate's has [m]."""
        return self.centre

    @property
    def top(self) -> float:
        """[m]"""
        return self.centre[2] + self.half[2]

    def to_local(self, p: Vec3) -> Vec3:
        """A point of the world in the axes of the box, from its centre [m]."""
        c = self.centre
        return in_frame((p[0] - c[0], p[1] - c[1], p[2] - c[2]), *self.axes)

    def distance(self, point: Vec3) -> float:
        """From a point to its surface, 0 inside [m]."""
        return hypot(
            *(max(abs(d) - h, 0.0) for d, h in zip(self.to_local(point), self.half, strict=True))
        )

    def outline(self, border: float = 0.0) -> np.ndarray:
        """Its corners from above, in turn, each side `border` [m] farther out.  (4, 2)"""
        (x, y, _), turn = self.half, np.array(self.axes)[:2, :2]
        signs = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])
        return signs * (x + border, y + border) @ turn + self.centre[:2]

    def corners(self) -> np.ndarray:
        """(8, 3)"""
        return _corners(self.outline(), self.centre[2] - self.half[2], self.top)


@dataclass(frozen=True)
class Cylinder:
    """A vertical cylinder."""

    base: Vec3  # centre of its lower end [m]
    radius: float  # [m]
    height: float  # [m]

    @property
    def top(self) -> float:
        """[m]"""
        return self.base[2] + self.height

    @property
    def centre(self) -> Vec3:
        """[m]"""
        x, y, z = self.base
        return x, y, z + self.height / 2

    def distance(self, point: Vec3) -> float:
        """From a point to its surface, 0 inside [m]."""
        x, y, z = self.base
        beside = hypot(point[0] - x, point[1] - y) - self.radius
        return hypot(max(beside, 0.0), max(z - point[2], point[2] - self.top, 0.0))

    def outline(self, border: float = 0.0) -> np.ndarray:
        """Points on its circle from above, in turn, `border` [m] farther out.  (ROUND, 2)"""
        turn = 2.0 * pi * np.arange(ROUND) / ROUND
        return (self.radius + border) * np.column_stack([np.cos(turn), np.sin(turn)]) + self.base[
            :2
        ]

    def corners(self) -> np.ndarray:
        """Those of the upright box around it.  (8, 3)"""
        r = self.radius
        around = np.array(list(product((-r, r), repeat=2))) + self.base[:2]
        return _corners(around, self.base[2], self.top)


Obstacle = Box | Cylinder


def _corners(outline: np.ndarray, low: float, high: float) -> np.ndarray:
    """An outline (n, 2) at two heights.  (2 n, 3)"""
    return np.vstack([np.column_stack([outline, np.full(len(outline), z)]) for z in (low, high)])
