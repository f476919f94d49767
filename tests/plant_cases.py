"""Rotors and skips that the tests of the plants share."""

import pytest

from quadsim.physics.plant import has_bullet
from quadsim.vehicle import Rotors

NO_BULLET = "PyBullet is not installed: its wheels end at Python 3.11"
needs_bullet = pytest.mark.skipif(not has_bullet(), reason=NO_BULLET)

FULL = 8.5  # strongest rotor thrust of RACER [N]
ROTORS = Rotors(
    positions=((0.0775, -0.1), (-0.0775, 0.1), (0.0775, 0.1), (-0.0775, -0.1)),
    spin=(-1, -1, 1, 1),
    thrust_map=(FULL / 3000.0**2, 0.0, 0.0),
    omega_min=0.0,
    omega_max=3000.0,
    tau=0.04,
    kappa=0.014,
)
