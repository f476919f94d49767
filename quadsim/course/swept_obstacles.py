"""The segment of one physics step against obstacles: contact of a sphere whose centre moves on it.

As for gates (quadsim.course.swept) the obstacle is grown by the sphere's radius r, edges not
rounded: contact is found up to .42 r early at edges, .73 r at a box's corners, and exactly on faces
and on the side of a cylinder.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, sqrt

import numpy as np

from quadsim.course.obstacles import Cylinder, Obstacle
from quadsim.course.swept import Incident, clip, lerp
from quadsim.rotation import Vec3


class SweptObstacle:
    """One obstacle and the radius of what flies past it [m]."""

    def __init__(self, obstacle: Obstacle, index: int, radius: float):
        self.obstacle, self.index, self.radius = obstacle, index, radius
        low, high = obstacle.corners().min(axis=0) - radius, obstacle.corners().max(axis=0) + radius
        # of the upright box around all of it
        self.low, self.high = tuple(low.tolist()), tuple(high.tolist())
        # radius about its centre outside which nothing touches it [m]
        self.reach = dist(self.low, self.high) / 2

    def touch(self, p0: Vec3, p1: Vec3) -> float | None:
        """Fraction of the segment at which the sphere first touches it, None if it does not."""
        if isinstance(self.obstacle, Cylinder):
            return self._touch_cylinder(p0, p1)
        x, y, z = self.obstacle.half
        half = (x + self.radius, y + self.radius, z + self.radius)
        inside = clip(
            self.obstacle.to_local(p0),
            self.obstacle.to_local(p1),
            (-half[0], -half[1], -half[2]),
            half,
        )
        return inside and inside[0]

    def _touch_cylinder(self, p0: Vec3, p1: Vec3) -> float | None:
        inside = clip(p0, p1, self.low, self.high)
        if inside is None:
            return None
        x, y, _ = self.obstacle.centre
        a, b = lerp(p0, p1, inside[0]), lerp(p0, p1, inside[1])  # the part at its height
        half_width = (self.high[0] - self.low[0]) / 2
        ax, ay, dx, dy = a[0] - x, a[1] - y, b[0] - a[0], b[1] - a[1]
        outside = ax * ax + ay * ay - half_width * half_width
        if outside <= 0.0:
            return inside[0]
        length2, along = dx * dx + dy * dy, ax * dx + ay * dy
        root = along * along - length2 * outside
        if root < 0.0 or along >= 0.0 or -along - sqrt(root) > length2:
            return None
        return inside[0] + (inside[1] - inside[0]) * (-along - sqrt(root)) / length2


class SweptObstacles:
    """All obstacles of a course, for a vehicle of this radius [m]."""

    def __init__(self, obstacles: Sequence[Obstacle], radius: float):
        self.all = tuple(SweptObstacle(obstacle, k, radius) for k, obstacle in enumerate(obstacles))
        self._centres = np.array([s.obstacle.centre for s in self.all]).reshape(-1, 3)
        self._reach = np.array([s.reach for s in self.all])

    def incidents(self, p0: Vec3, p1: Vec3) -> list[Incident]:
        """Contacts within the segment."""
        if not self.all:
            return []
        middle, half = lerp(p0, p1, 0.5), dist(p0, p1) / 2
        gap = ((self._centres - middle) ** 2).sum(axis=1)
        near = (self.all[k] for k in np.flatnonzero(gap <= (self._reach + half) ** 2))
        return [
            Incident(t, "touch", obstacle=s.index)
            for s in near
            if (t := s.touch(p0, p1)) is not None
        ]
