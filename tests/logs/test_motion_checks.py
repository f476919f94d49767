"""Signals of one log against each other: another unit, frame or time is found, and named."""

import pytest

from quadsim.logs.cleaning import cleaned
from quadsim.logs.raw_log import LogError
from tests.identify.mistakes import MISTAKES, log_of, vehicle_of

REFUSED = {
    "gyro in rad/s read as deg/s": "body_rates: expected the derivative of the attitude",
    "gyro in deg/s read as rad/s, no pose": "body_rates: expected body rates .rad/s. from -100",
    "gyro of twice the scale": "body_rates: .* got 2.0. times that",
    "accelerometer of twice the scale": "specific_force: .* got 2 times that",
    "accelerometer of twice the scale, no pose": "specific_force: .* got 2 g",
    "accelerometer without gravity": "the accelerometer is without gravity",
    "north and east exchanged": "x and y of the velocity are exchanged",
    "velocity in the body's axes": "the velocity is in the body's axes",
    "attitude turned by 90 degrees": "the attitude is turned by 90 deg",
    "north, east, down read as east, north, up": "the log is in NED and FRD",
    "xyzw read as wxyz, no gyro": "the quaternion is x, y, z, w",
    "attitude the other way round, no gyro": "the quaternion turns the world into the body",
    "pose late by .15 s": "quaternion: expected an attitude at most 0.06 s later .* got 0.15 s",
    "position in mm, no velocity": "velocity: expected a velocity that changes by",
    "setpoints in deg/s read as rad/s": "rate_setpoints: expected rate setpoints .rad/s. from -100",
}


@pytest.mark.parametrize(("mistake", "problem"), REFUSED.items())
def test_a_mistake_in_units_frames_and_time_is_refused_with_its_cause(mistake, problem):
    with pytest.raises(LogError, match=problem) as error:
        cleaned(log_of(vehicle_of(0), MISTAKES[mistake], 0))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("mistake", ["none", "none, without a pose"])
def test_a_log_without_a_mistake_is_read(mistake):
    assert cleaned(log_of(vehicle_of(1), MISTAKES[mistake], 1)).pieces
