"""Find contacts of a moving sphere with obstacles within one physics step.

As for gates (quadsim.course.swept), obstacles are grown by the sphere's radius r, without rounded
edges: contact is found up to .42 r early at edges, .73 r at a box's corners, and exactly on faces
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
    """One obstacle and the radius of a sphere that flies past it [m]."""

    def __init__(self, obstacle: Obstacle, index: int, radius: float):
        """Prepare the tests of one obstacle.

        Args:
            obstacle: obstacle of the course.
            index: index of the obstacle, which its incidents carry.
            radius: radius of the sphere [m].
        """
        self.obstacle = obstacle
        self.index = index
        self.radius = radius
        # corners of the upright box around the grown obstacle [m]
        corners = obstacle.corners()
        self.low: Vec3 = tuple((corners.min(axis=0) - radius).tolist())
        self.high: Vec3 = tuple((corners.max(axis=0) + radius).tolist())
        # radius about the centre outside which nothing touches the obstacle [m]
        self.reach = dist(self.low, self.high) / 2

    def touch(self, p0: Vec3, p1: Vec3) -> float | None:
        """Return the fraction of a segment at which the sphere first touches the obstacle.

        Args:
            p0, p1: ends of the segment in the world [m].

        Returns:
            The fraction, from 0 to 1; None if there is no contact.
        """
        if isinstance(self.obstacle, Cylinder):
            return self._touch_cylinder(self.obstacle, p0, p1)
        x, y, z = self.obstacle.half
        half = (x + self.radius, y + self.radius, z + self.radius)
        low = (-half[0], -half[1], -half[2])
        inside = clip(self.obstacle.to_local(p0), self.obstacle.to_local(p1), low, half)
        return inside[0] if inside else None

    def _touch_cylinder(self, cylinder: Cylinder, p0: Vec3, p1: Vec3) -> float | None:
        """Return the fraction of a segment at which the sphere first touches a cylinder."""
        # The part of the segment in the upright box around the cylinder, from a to b.
        inside = clip(p0, p1, self.low, self.high)
        if inside is None:
            return None
        s_in, s_out = inside
        a = lerp(p0, p1, s_in)
        b = lerp(p0, p1, s_out)

        # From above, |a + s (b - a)| = radius is a quadratic equation for s, from the centre.
        x, y, _ = cylinder.centre
        radius = (self.high[0] - self.low[0]) / 2
        ax = a[0] - x
        ay = a[1] - y
        dx = b[0] - a[0]
        dy = b[1] - a[1]
        outside = ax * ax + ay * ay - radius * radius
        if outside <= 0.0:
            return s_in
        square = dx * dx + dy * dy
        along = ax * dx + ay * dy
        root = along * along - square * outside
        if root < 0.0 or along >= 0.0 or -along - sqrt(root) > square:
            return None
        return s_in + (s_out - s_in) * (-along - sqrt(root)) / square


class SweptObstacles:
    """All obstacles of a course, for a vehicle of one radius."""

    def __init__(self, obstacles: Sequence[Obstacle], radius: float):
        """Prepare the tests of all obstacles.

        Args:
            obstacles: obstacles of the course, in order.
            radius: radius of the vehicle [m].
        """
        self.all = tuple(SweptObstacle(obstacle, k, radius) for k, obstacle in enumerate(obstacles))
        self._centres = np.array([s.obstacle.centre for s in self.all]).reshape(-1, 3)
        self._reach = np.array([s.reach for s in self.all])

    def incidents(self, p0: Vec3, p1: Vec3) -> list[Incident]:
        """Return the contacts of a segment.

        Args:
            p0, p1: ends of the segment in the world [m].
        """
        if not self.all:
            return []
        square = ((self._centres - lerp(p0, p1, 0.5)) ** 2).sum(axis=1)
        near = square <= (self._reach + dist(p0, p1) / 2) ** 2
        found = []
        for k in np.flatnonzero(near):
            fraction = self.all[k].touch(p0, p1)
            if fraction is not None:
                found.append(Incident(fraction, "touch", obstacle=self.all[k].index))
        return found
