"""Geometry: the arms and directions of the rotors, which no log has."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.dynamics.allocation import mixer
from quadsim.identify.numbers import FitNumbers
from quadsim.rotation import Vec3
from quadsim.vehicle import Vehicle


class Geometry(NamedTuple):
    """Arms and directions of the rotors of the prior vehicle."""

    signs: np.ndarray  # of the rotors' thrusts in the torques about x, y, z  (3, 4)
    arm_x: float  # of the rotors [m]
    arm_y: float

    @classmethod
    def of(cls, vehicle: Vehicle) -> Geometry:
        """Return the geometry of a vehicle with rotors."""
        assert vehicle.rotors
        x, y = vehicle.rotors.positions[2]
        signs = np.sign(np.array(mixer(vehicle.rotors))[1:])
        return cls(signs, x, y)

    def mirrored(self) -> Geometry:
        """Return the geometry of the same vehicle whose rotors turn the other way round."""
        return self._replace(signs=self.signs * np.array([[1.0], [1.0], [-1.0]]))

    def inertia(self, numbers: FitNumbers) -> Vec3:
        """Return the inertia over the mass [m^2]."""
        jx = numbers.inertia_x * self.arm_y
        jy = numbers.inertia_y * self.arm_x
        return jx, jy, 0.5 * numbers.flatness * (jx + jy)
