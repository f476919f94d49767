"""Errors of a gyro against a measured attitude."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.identify.gyro import gyro_errors
from quadsim.identify.prepared import prepare
from quadsim.identify.stretches import stretches
from quadsim.vehicle import load_vehicle
from tests.identify.fit_cases import flight, noisy

BIAS = np.array([0.01, -0.02, 0.005])  # [rad/s]
SCALE = np.array([0.02, -0.01, 0.0])
TILT = np.array([0.02, -0.01, 0.03])  # turn of the gyro's axes [rad]


def errors_of(log):
    return gyro_errors(prepare(stretches(log), load_vehicle("swift")))


def test_bias_scale_and_tilt_of_a_gyro_are_found():
    log = noisy(flight(seconds=16.0))
    rates = log.body_rates
    wrong = rates + BIAS + SCALE * rates - np.cross(TILT, rates)
    found = {number.key: number for number in errors_of(replace(log, body_rates=wrong))}
    for name, true in (("bias", BIAS), ("scale", SCALE), ("tilt", TILT)):
        for axis, value in zip("xyz", true, strict=True):
            number = found[f"gyro_{name}.{axis}"]
            assert number.value == pytest.approx(value, abs=max(3.0 * number.std, 2e-3))
            assert number.std < 0.01


def test_a_log_without_turns_or_attitude_tells_nothing():
    assert errors_of(flight(yaw=0.0)) == ()
    assert errors_of(replace(flight(), quaternion=None, position=None, velocity=None)) == ()
