"""The term that keeps clear: an ellipsoid that is taller below, and expected paths step by step."""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest

from quadsim.controllers.costs.keep_clear import NOWHERE, Clearance, KeepClear, keep_clear
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.expected_path import ExpectedPath, OtherVehicle

CLEARANCE = Clearance(weight=200.0, keep=0.6, above=0.8, below=0.4)
TERM = KeepClear(vehicle=3, name="clear_of_1", clearance=CLEARANCE, horizon=3)
HERE = np.zeros(17)


def missing(dx=0.0, dz=0.0):
    """Return the term beside a vehicle at the origin."""
    p = TERM.parameters._replace(x=0.0, y=0.0, z=0.0)
    here = SimpleNamespace(px=dx, py=0.0, pz=dz)
    return float(keep_clear(None, here, None, None, p))


def test_it_is_largest_at_the_vehicle_and_zero_from_the_kept_distance_on():
    values = [missing(dx) for dx in (0.0, 0.2, 0.4, 0.599)]
    assert values == sorted(values, reverse=True)
    assert values[0] == pytest.approx(0.6)
    assert missing(0.6) == pytest.approx(0.0)
    assert missing(2.0) == 0.0


def test_the_room_reaches_farther_below_than_above():
    assert missing(dz=0.7) > 0.0 == missing(dz=0.8)
    assert missing(dz=-1.4) > 0.0
    assert missing(dz=-1.5) == pytest.approx(0.0)


def test_expected_places_follow_from_the_estimate_and_the_term_does_not_change():
    places = np.arange(9.0).reshape(3, 3)
    path = ExpectedPath(1.0, 0.5, places)
    times = np.array([1.0, 1.5, 2.0])
    others = (OtherVehicle(2, ExpectedPath(0.0, 1.0, -places)), OtherVehicle(3, path))
    found = TERM.numbers_from(Estimate(1.0, HERE, others=others), times)
    assert {name: value.tolist() for name, value in found.items()} == {
        "x": [0.0, 3.0, 6.0],
        "y": [1.0, 4.0, 7.0],
        "z": [2.0, 5.0, 8.0],
    }
    assert (TERM.parameters.x == NOWHERE).all()


@pytest.mark.parametrize("others", [(), (OtherVehicle(2, ExpectedPath(0.0, 1.0, np.eye(3))),)])
def test_a_vehicle_that_the_estimate_does_not_have_is_nowhere(others):
    found = TERM.numbers_from(Estimate(1.0, HERE, others=others), np.arange(3.0))
    assert (found["x"] == NOWHERE).all()


def test_shares_are_factors_on_weight_and_distance():
    assert TERM.scaled() == {"weight": 200.0, "keep": 0.6, "per_square": 1 / 0.6**2}
    assert TERM.scaled(0.5, 0.5) == {"weight": 100.0, "keep": 0.3, "per_square": 1 / 0.3**2}


def test_a_term_in_another_process_is_of_the_same_vehicle():
    again = pickle.loads(pickle.dumps(TERM))
    assert (again.vehicle, again.name, again.clearance) == (3, "clear_of_1", CLEARANCE)
    assert again.shape == TERM.shape
