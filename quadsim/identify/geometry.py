"""Geometry: what a log does not tell of the torques."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.identify.numbers import Numbers
from quadsim.physics.allocation import mixer
from quadsim.rotation import Vec3
from quadsim.vehicle import Vehicle


class Geometry(NamedTuple):
    """Arms, directions and flatness of the prior vehicle."""

    signs: np.ndarray  # of the rotors' thrusts in the torques about x, y, z  (3, 4)
    arm_x: float  # of the rotors [m]
    arm_y: float
    # inertia about z over the mean of the other two: a log tells it over the reaction torque alone
    flatness: float

    @classmethod
    def of(cls, vehicle: Vehicle) -> Geometry:
        """Return the geometry of a vehicle with rotors."""
        assert vehicle.rotors
        x, y = vehicle.rotors.positions[2]
        jx, jy, jz = vehicle.inertia
        signs = np.sign(np.array(mixer(vehicle.rotors))[1:])
        return cls(signs, x, y, 2.0 * jz / (jx + jy))

    def mirrored(self) -> Geometry:
        """Return the geometry of the same vehicle whose rotors turn the other way round."""
        return self._replace(signs=self.signs * np.array([[1.0], [1.0], [-1.0]]))

    def inertia(self, numbers: Numbers) -> Vec3:
        """Return the inertia over the mass [m^2]."""
        jx = numbers.inertia_x * self.arm_y
        jy = numbers.inertia_y * self.arm_x
        return jx, jy, 0.5 * self.flatness * (jx + jy)
