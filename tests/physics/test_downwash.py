"""Downwash: a push along the upper vehicle's jet, never more than its thrust, and none above it."""

import numpy as np
import pytest

from quadsim.dynamics.quadrotor import State
from quadsim.physics.downwash import REACH, Downwash
from quadsim.vehicle import load_vehicle, vehicle_names

SWIFT = Downwash(load_vehicle("swift"))


def at(x, y, z, attitude=(1.0, 0.0, 0.0, 0.0), thrust=9.81):
    return State.of((x, y, z), (0.0,) * 3, attitude, (0.0,) * 3, thrust, (0.0,) * 3)


def push(below, aside=0.0, above=SWIFT, thrust=9.81):
    """Return the force on a swift at this place below another vehicle [N]."""
    return above.force_on(SWIFT, at(0.0, 0.0, 9.0, thrust=thrust), at(aside, 0.0, 9.0 - below))


@pytest.mark.parametrize("name", vehicle_names())
def test_the_force_is_less_than_the_thrust_and_falls_with_distance(name):
    vehicle = Downwash(load_vehicle(name))
    if not load_vehicle(name).rotors:
        assert push(1.0, above=vehicle) is None
        return
    forces = [-push(below, above=vehicle)[2] for below in (0.2, 0.5, 1.0, 2.0, 5.0)]
    assert vehicle.vehicle.mass * 9.81 > forces[0]
    assert forces == sorted(forces, reverse=True)
    assert forces[-1] > 0.0


def test_it_grows_with_the_thrust_and_falls_to_the_side():
    assert push(1.0, thrust=19.62)[2] == pytest.approx(2 * push(1.0)[2])
    asides = [-push(1.0, aside)[2] for aside in (0.0, 0.2, 0.5, 1.0)]
    assert asides == sorted(asides, reverse=True)
    assert asides[-1] < 1e-6


def test_above_and_far_below_there_is_none():
    assert push(-1.0) is None
    assert push(REACH + 0.1) is None


def test_the_jet_points_away_from_the_thrust():
    # pitched by 90 degrees: the thrust points along x, the jet along -x
    pitched = at(0.0, 0.0, 9.0, attitude=(np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0))
    x, _, z = SWIFT.force_on(SWIFT, pitched, at(-1.0, 0.0, 9.0))
    assert x < -1.0
    assert z == pytest.approx(0.0, abs=1e-9)
    assert SWIFT.force_on(SWIFT, pitched, at(0.0, 0.0, 8.0)) is None
