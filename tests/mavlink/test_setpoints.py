"""What a client asks for, flown by the plain rigid body."""

from math import cos, pi, sin

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.mavlink.messages import SetAttitudeTarget, SetPositionTargetLocalNed
from quadsim.mavlink.setpoints import attitude_setpoint, control_of, path_setpoint
from quadsim.physics.plant import RigidPlant
from quadsim.rotation import euler_angles
from quadsim.vehicle import GRAVITY, load_vehicle

ARCHER = load_vehicle("archer")
HOVER = GRAVITY / ARCHER.thrust_max
# position and velocity, or one of them, and yaw; rates of yaw and accelerations are ignored
VELOCITY_AND_YAW = 0b100111000111
POSITION_AND_YAW = 0b100111111000


def flown(setpoint, seconds=2.5):
    """Return the state after a setpoint was flown for a time, from a start in the air."""
    course = load_course("aigp_physical").but(start={"position": [10, 20, 4], "yaw_deg": 90})
    plant = RigidPlant(course, ARCHER)
    for step in range(round(seconds / plant.dt)):
        if step % 4 == 0:
            control = control_of(setpoint, plant.state.x, ARCHER)
        plant.step(control)
    return plant.state.x


def path(mask, numbers, yaw):
    """Return the setpoint of nine numbers and a yaw."""
    return path_setpoint(SetPositionTargetLocalNed(0, 1, 1, 1, mask, *numbers, yaw, 0.0))


def test_a_velocity_is_reached_with_its_yaw():
    # 2 m/s to the east and 1 m/s up, the nose to the east
    x = flown(path(VELOCITY_AND_YAW, (0, 0, 0, 0, 2, -1, 0, 0, 0), yaw=pi / 2))
    assert x.velocity == pytest.approx((2.0, 0.0, 1.0), abs=0.4)
    yaw, _, _ = euler_angles(x.attitude)
    assert yaw == pytest.approx(0.0, abs=0.1)


def test_a_position_is_reached():
    # north, east, down of a point 2 m to the east of the start, and 1 m below it
    x = flown(path(POSITION_AND_YAW, (20, 12, -3, 0, 0, 0, 0, 0, 0), yaw=0.0), seconds=5.0)
    assert x.position == pytest.approx((12.0, 20.0, 3.0), abs=0.2)


def test_an_attitude_is_reached_and_held_against_gravity():
    # the nose to the north, 0.2 rad down
    tilted = SetAttitudeTarget(0, 1, 1, 7, (cos(0.1), 0.0, -sin(0.1), 0.0), 0, 0, 0, HOVER)
    setpoint = attitude_setpoint(tilted, ARCHER)
    assert setpoint is not None
    x = flown(setpoint, seconds=1.0)
    _, pitch, roll = euler_angles(x.attitude)
    assert pitch == pytest.approx(0.2, abs=0.03)
    assert roll == pytest.approx(0.0, abs=0.03)
    assert x.vy > 1.0


def test_body_rates_and_thrust_are_flown_as_they_come():
    asked = SetAttitudeTarget(0, 1, 1, 128, (1.0, 0.0, 0.0, 0.0), 0.5, 0.25, 0.1, HOVER)
    setpoint = attitude_setpoint(asked, ARCHER)
    assert setpoint is not None
    control = control_of(setpoint, flown(setpoint, seconds=0.1), ARCHER)
    assert np.array(control) == pytest.approx([0.5, -0.25, -0.1, GRAVITY])
