"""The allocation: what four rotors can give is mixed back exactly, and what they cannot is given up
in order."""

import numpy as np
import pytest
from plant_cases import FULL, ROTORS

from quadsim.dynamics.allocation import allocate, mixer, shares

MIXER, SHARES = np.array(mixer(ROTORS)), shares(ROTORS)


def demands(n=300, scale=1.0):
    """Random collectives [N] and torques [N m], the larger ones beyond what the rotors can give."""
    rng = np.random.default_rng(1)
    return zip(
        rng.uniform(0, 4 * FULL, n),
        rng.normal(scale=[0.8, 0.6, 0.3], size=(n, 3)) * scale,
        strict=True,
    )


def test_mixing_returns_every_demand_the_rotors_can_give():
    for collective, torque in demands(scale=0.02):
        thrusts = allocate(SHARES, collective, torque, -np.inf, np.inf)
        np.testing.assert_allclose(MIXER @ thrusts, (collective, *torque), atol=1e-12)


def test_torques_about_body_axes_load_the_rotors_of_the_right_side():
    x, y = np.array(ROTORS.positions).T
    for axis, louder in enumerate([y > 0, x < 0, np.array(ROTORS.spin) > 0]):
        thrusts = np.array(allocate(SHARES, 4.0, np.eye(3)[axis] * 0.01, 0.0, FULL))
        assert (thrusts[louder] > 1.0).all()
        assert (thrusts[~louder] < 1.0).all()


def test_no_demand_drives_a_rotor_out_of_its_range():
    thrusts = np.array([allocate(SHARES, c, torque, 0.2, FULL) for c, torque in demands()])
    assert thrusts.min() >= 0.2
    assert thrusts.max() <= FULL
    saturated = (np.isclose(thrusts, 0.2) | np.isclose(thrusts, FULL)).any(axis=1)
    assert 0.3 < saturated.mean() < 1.0  # the demands do test the limits, and not only those


def test_yaw_is_given_up_before_anything_else():
    demand = (12.0, 0.3, -0.2, 5.0)
    thrusts = allocate(SHARES, demand[0], demand[1:], 0.0, FULL)
    collective, *torque = MIXER @ thrusts
    np.testing.assert_allclose((collective, *torque[:2]), demand[:3], atol=1e-12)
    assert 0.0 < torque[2] < 5.0
    # and no more than needed
    assert min(thrusts) == pytest.approx(0.0) or max(thrusts) == pytest.approx(FULL)


@pytest.mark.parametrize(("collective", "moves"), [(4 * FULL, -1), (0.0, 1)])
def test_the_collective_gives_way_to_roll_and_pitch(collective, moves):
    delivered, *torque = MIXER @ allocate(SHARES, collective, (0.5, 0.3, 0.0), 0.0, FULL)
    np.testing.assert_allclose(torque, (0.5, 0.3, 0.0), atol=1e-12)
    assert moves * (delivered - collective) > 1.0


def test_an_impossible_tilt_keeps_its_direction():
    _, roll, pitch, yaw = MIXER @ allocate(SHARES, 20.0, (9.0, 6.0, 1.0), 0.0, FULL)
    assert roll / pitch == pytest.approx(1.5)
    assert 0.5 < roll < 9.0
    assert yaw == pytest.approx(0.0, abs=1e-12)
