"""The term that keeps clear: an ellipsoid that is taller below, and expected paths step by step."""

from types import SimpleNamespace

import numpy as np
import pytest

from controllers.costs.keep_clear import NOWHERE, OtherVehicle, Room, keep_clear

ROOM = Room(weight=200.0, keep=0.6, above=0.8, below=0.4)


def missing(dx=0.0, dz=0.0, other=None):
    """Return the term beside a vehicle at the origin."""
    other = other or OtherVehicle(1, ROOM, horizon=3)
    of_a_step = {
        name: float(np.ravel(value)[0]) for name, value in other.term.parameters._asdict().items()
    }
    p = other.term.parameters._replace(**of_a_step | {"x": 0.0, "y": 0.0, "z": 0.0})
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


def test_expected_places_are_parameters_of_the_steps():
    other = OtherVehicle(1, ROOM, horizon=3)
    assert (other.term.parameters.x == NOWHERE).all()
    places = np.arange(9.0).reshape(3, 3)
    other.expect(places, share=0.5)
    np.testing.assert_array_equal(other.term.parameters.z, places[:, 2])
    np.testing.assert_array_equal(other.term.weight, [100.0] * 3)
    np.testing.assert_array_equal(other.term.parameters.keep, [0.6] * 3)
    other.expect(places, keep_share=0.5)
    np.testing.assert_array_equal(other.term.parameters.keep, [0.3] * 3)
    np.testing.assert_allclose(other.term.parameters.per_square, [1 / 0.09] * 3)
    other.expect_nowhere()
    assert (other.term.parameters.x == NOWHERE).all()
