"""The plants, a course of nothing but sky, and the rotors that tests share."""

import pytest

from quadsim.course import Course, Gate, Start
from quadsim.physics.plant import BulletPlant, RigidPlant, has_bullet
from quadsim.physics.plant_state import PlantState
from quadsim.vehicle import GRAVITY, Rotors

NO_BULLET = "PyBullet is not installed: its wheels end at Python 3.11"
needs_bullet = pytest.mark.skipif(not has_bullet(), reason=NO_BULLET)
both_plants = [
    pytest.param(BulletPlant, marks=needs_bullet, id="bullet"),
    pytest.param(RigidPlant, id="rigid"),
]

DT = 1 / 400
HOVER = (0.0, 0.0, 0.0, GRAVITY)
GATE = Gate((50.0, 0.0, 200.0), 0.0, 0.0, 0.0, (2.4, 2.4), 0.3)
SKY = Course(
    "sky", "test", (GATE,), Start((1.0, 2.0, 200.0), 0.0), ((-99, 99),) * 3, False, 1, (), ""
)

FULL = 8.5  # strongest thrust of one rotor [N]
ROTORS = Rotors(
    rotor_x=0.0775,
    rotor_y=0.1,
    motor_omega_min=0.0,
    motor_omega_max=3000.0,
    motor_tau=0.04,
    thrust_map=(FULL / 3000.0**2, 0.0, 0.0),
    kappa=0.014,
)


class ModelPlant:
    """A system that is flown by its own step; it touches nothing."""

    def __init__(self, system, x0):
        self.dt = system.dt
        self._system = system
        self._steps = 0
        self.state = PlantState(0.0, system.state(*x0), ())

    def step(self, u):
        """Advance by one step of the system under the control u."""
        self._steps += 1
        x = self._system.next(self.state.x, u)
        self.state = PlantState(self._steps * self.dt, x, ())
        return self.state

    def close(self):
        """Release nothing, as nothing is held."""
