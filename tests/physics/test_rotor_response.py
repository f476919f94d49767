"""Rotors whose speed follows the equation of their file: faster up than down, and both exact."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.dynamics.rotors import Motors
from quadsim.files.values import SettingError
from quadsim.physics.domain_randomization import Randomization
from quadsim.vehicle import load_vehicle, parse_vehicle

CF21B = load_vehicle("cf21b_500")
SWIFT = load_vehicle("swift")
DT = 0.002


def speeds(command, seconds=0.1):
    """Return the speed of a rotor from hover on, under a command."""
    motors = Motors(CF21B, CF21B.rotors, DT)
    found = [motors.speeds[0]]
    for _ in range(round(seconds / DT)):
        motors.follow([command] * 4)
        found.append(motors.speeds[0])
    return np.array(found)


def integrated(command, seconds=0.1, fine=200):
    """Return the same by a fine explicit integration of W' = a (c - W) + b (c^2 - W^2)."""
    a_up, b_up, a_down, b_down = CF21B.rotors.motor_response
    speed = CF21B.rotors.speed(0.25 * CF21B.mass * 9.81)
    found = [speed]
    for _ in range(round(seconds / DT)):
        for _ in range(fine):
            a, b = (a_up, b_up) if command > speed else (a_down, b_down)
            speed += DT / fine * (a * (command - speed) + b * (command**2 - speed**2))
        found.append(speed)
    return np.array(found)


@pytest.mark.parametrize("command", [2268.0, 767.0])
def test_a_speed_follows_the_published_equation(command):
    found, wanted = speeds(command), integrated(command)
    np.testing.assert_allclose(found, wanted, rtol=0.005)
    # The negative control: the lag of the planner's model is not this equation.
    hover = found[0]
    lagging = command + (hover - command) * np.exp(
        -np.arange(len(found)) * DT / CF21B.rotors.motor_tau
    )
    assert np.abs(lagging - wanted).max() > 0.01 * abs(command - hover)


def test_a_vehicle_without_a_response_has_its_lag():
    lag = SWIFT.rotors.motor_tau
    assert SWIFT.rotors.lag(100.0, 2000.0) == SWIFT.rotors.lag(2000.0, 100.0) == lag


def test_randomized_motors_are_slower_by_the_drawn_share():
    slower = Randomization(motor_lag=0.2).vehicle(CF21B).rotors
    for command in (767.0, 2268.0):
        assert slower.lag(1500.0, command) == pytest.approx(1.2 * CF21B.rotors.lag(1500.0, command))


def test_a_file_keeps_its_response():
    again = parse_vehicle(CF21B.to_yaml(), "cf21b_500.yaml")
    assert again == CF21B
    without = CF21B.but(rotors={"motor_response": None})
    assert without.rotors == replace(CF21B.rotors, motor_response=None)


def test_a_response_that_never_moves_is_refused():
    with pytest.raises(SettingError, match="motor_response: expected a speed that follows"):
        CF21B.but(rotors={"motor_response": [0, 0, 5, 0.001]})
