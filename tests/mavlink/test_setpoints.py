"""What a client asks for, flown by the plain rigid body."""

from math import cos, inf, isnan, nan, pi, sin

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.mavlink.messages import SetAttitudeTarget, SetPositionTargetLocalNed
from quadsim.mavlink.setpoints import (
    AttitudeTarget,
    BodyTarget,
    Law,
    PathTarget,
    Rates,
    SetpointError,
    attitude_setpoint,
    path_setpoint,
)
from quadsim.physics.plant import RigidPlant
from quadsim.rotation import euler_angles
from quadsim.vehicle import GRAVITY, load_vehicle

ARCHER = load_vehicle("archer")
HOVER = GRAVITY / ARCHER.thrust_max
# position and velocity, or one of them, and yaw; rates of yaw and accelerations are ignored
VELOCITY_AND_YAW = 0b100111000111
POSITION_AND_YAW = 0b100111111000


def flown(setpoint, seconds=2.5, yaw_deg=90):
    """Return the state after a setpoint was flown for a time, from a start in the air."""
    start = {"position": [10, 20, 4], "yaw_deg": yaw_deg}
    course = load_course("aigp_physical").but(start=start)
    plant = RigidPlant(course, ARCHER)
    law = Law(setpoint, ARCHER)
    for step in range(round(seconds / plant.dt)):
        if step % 4 == 0:
            control = law(plant.state.x)
        plant.step(control)
    return plant.state.x


def path(mask, numbers, yaw=0.0, yaw_rate=0.0, frame=1):
    """Return the setpoint of nine numbers and a yaw."""
    return path_setpoint(SetPositionTargetLocalNed(0, 1, 1, frame, mask, *numbers, yaw, yaw_rate))


# How PX4 1.15 reads SET_POSITION_TARGET_LOCAL_NED, mavlink_receiver.cpp and PositionControl.cpp. In
# the frame of the world, north and east need the same numbers of these, and down any of them; in
# that of the body, position is left out, and a vector whose axes do not all count, too.
NUMBERS = ("position", "velocity", "acceleration")
GIVEN = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)


def counted(mask):
    """Return for each axis the numbers that a mask does not ignore."""
    return [
        {name for k, name in enumerate(NUMBERS) if not mask >> (3 * k + i) & 1} for i in (0, 1, 2)
    ]


def is_taken(mask, frame):
    """Return whether a mask is flown: as PX4 flies it, and nothing that it asks for is left out."""
    north, east, down = counted(mask)
    if mask & 512 and "acceleration" in north | east | down:
        return False  # a force
    if frame == 8:
        return bool(north) and north == east == down and "position" not in north
    return bool(north) and north == east and bool(down)


def is_refused(*setpoint):
    """Return whether a setpoint is refused, with a reason that a STATUSTEXT holds."""
    try:
        path(*setpoint)
    except SetpointError as error:
        return str(error).startswith("setpoint refused: ") and len(str(error)) <= 50
    return False


@pytest.mark.parametrize(("frame", "count"), [(1, 232), (8, 16)])
def test_each_of_the_4096_masks_is_flown_as_px4_does_or_refused(frame, count):
    """Ignored numbers are NaN, as MAVSDK sends them: they change nothing."""
    taken = 0
    for mask in range(4096):
        numbers = [nan if mask >> k & 1 else value for k, value in enumerate(GIVEN)]
        yaw = nan if mask & 1024 else 0.5
        rate = nan if mask & 2048 else 0.25
        if not is_taken(mask, frame):
            assert is_refused(mask, numbers, yaw, rate, frame)
            continue
        taken += 1
        found = path(mask, numbers, yaw, rate, frame)
        assert isinstance(found, BodyTarget if frame == 8 else PathTarget)
        assert found.yaw == (None if mask & 1024 else pytest.approx(pi / 2 - 0.5))
        assert found.yaw_rate == (0.0 if mask & 2048 else -0.25)
        for k, name in enumerate(NUMBERS):
            given = numbers[3 * k : 3 * k + 3]
            x, y, z = given
            wanted = (x, -y, -z) if frame == 8 else (y, x, -z)
            if frame == 1 or name != "position":
                assert np.array_equal(getattr(found, name), wanted, equal_nan=True)
        # Any number in an ignored field is as good as NaN.
        zeros = [0.0 if isnan(number) else number for number in numbers]
        again = path(mask, zeros, 0.0 if isnan(yaw) else yaw, 0.0 if isnan(rate) else rate, frame)
        assert str(again) == str(found)
    assert taken == count


@pytest.mark.parametrize("frame", [0, 7, 9, 12, 20])
def test_a_frame_that_px4_does_not_take_is_refused(frame):
    with pytest.raises(SetpointError, match=f"setpoint refused: frame {frame}, expected 1 or 8"):
        path(VELOCITY_AND_YAW, GIVEN, frame=frame)


def test_nan_in_a_field_that_counts_is_ignored_and_infinity_is_refused():
    only_velocity = path(0, [nan, nan, nan, 1, 2, 3, nan, nan, nan])
    assert str(only_velocity) == str(path(0b111000111, (*GIVEN[:3], 1, 2, 3, *GIVEN[6:])))
    with pytest.raises(SetpointError, match="setpoint refused: a number is infinite"):
        path(0, [inf, *GIVEN[1:]])


def test_north_by_velocity_with_a_height_flies_north_at_the_height():
    """Mask 4035 ignores position in x and y alone."""
    x = flown(path(4035, (0, 0, -5, 1, 0, 0, 0, 0, 0)), seconds=3.0)
    assert x.velocity == pytest.approx((0.0, 1.0, 0.0), abs=0.2)
    assert x.position == pytest.approx((10.0, 22.4, 5.0), abs=0.3)


def test_a_place_with_a_climb_stays_at_the_place():
    """Mask 476 has position in x and y, and velocity in z."""
    x = flown(path(476, (20, 10, 99, 99, 99, -1, 99, 99, 99)), seconds=3.0)
    assert x.position == pytest.approx((10.0, 20.0, 6.7), abs=0.3)
    assert x.vz == pytest.approx(1.0, abs=0.1)


def test_acceleration_alone_is_flown():
    x = flown(path(3135, (0, 0, 0, 0, 0, 0, 1, 0, 0)), seconds=2.0)
    assert x.velocity == pytest.approx((0.0, 1.8, 0.0), abs=0.4)


def test_forward_in_the_frame_of_the_body_is_where_the_nose_points_when_it_comes():
    """While it yaws it flies on to the south-west: PX4 turns the axes when the setpoint comes."""
    ahead = path(1479, (0, 0, 0, 2, 0, 0, 0, 0, 0), yaw_rate=0.5, frame=8)
    x = flown(ahead, yaw_deg=225)
    assert x.velocity == pytest.approx((-(2**0.5), -(2**0.5), 0.0), abs=0.3)
    yaw, _, _ = euler_angles(x.attitude)
    assert abs(yaw - (-3 * pi / 4)) > 0.8


@pytest.mark.parametrize("mask", range(256))
def test_each_mask_of_an_attitude_is_flown_or_refused(mask):
    """Ignored fields are NaN. Thrust is needed, and an attitude or rates of roll and pitch."""
    rates = [nan if mask & bit else rate for bit, rate in ((1, 0.5), (2, 0.25), (4, 0.1))]
    q = (nan,) * 4 if mask & 128 else (1.0, 0.0, 0.0, 0.0)
    message = SetAttitudeTarget(0, 1, 1, mask, q, *rates, nan if mask & 64 else HOVER)
    if mask & (32 | 64) or (mask & 128 and mask & 3):
        with pytest.raises(SetpointError, match="setpoint refused: ") as refused:
            attitude_setpoint(message, ARCHER)
        assert len(str(refused.value)) <= 50
        return
    found = attitude_setpoint(message, ARCHER)
    assert isinstance(found, Rates if mask & 128 else AttitudeTarget)
    free = 0.0 if mask & 128 else None
    wanted = [
        free if isnan(rate) else sign * rate for rate, sign in zip(rates, (1, -1, -1), strict=True)
    ]
    assert list(found.body_rates) == wanted
    assert found.thrust == pytest.approx(GRAVITY)


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
    x = flown(setpoint, seconds=1.0)
    _, pitch, roll = euler_angles(x.attitude)
    assert pitch == pytest.approx(0.2, abs=0.03)
    assert roll == pytest.approx(0.0, abs=0.03)
    assert x.vy > 1.0


def test_body_rates_and_thrust_are_flown_as_they_come():
    asked = SetAttitudeTarget(0, 1, 1, 128, (1.0, 0.0, 0.0, 0.0), 0.5, 0.25, 0.1, HOVER)
    setpoint = attitude_setpoint(asked, ARCHER)
    control = Law(setpoint, ARCHER)(flown(setpoint, seconds=0.1))
    assert np.array(control) == pytest.approx([0.5, -0.25, -0.1, GRAVITY])
