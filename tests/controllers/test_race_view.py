"""The view term: nothing where the camera looks at the next gate, twice the weight where it looks away."""

import numpy as np
import pytest

from controllers.costs.race import RaceWeights, race_cost, terms
from controllers.costs.race_view import nose, with_view
from controllers.rollout.inline import lane_source
from quadsim.course import load_course
from quadsim.race.settings import SettingError
from quadsim.race.spec import Spec
from quadsim.sensing.attitude import exp, matrix, product

TILT = np.radians(20.0)
AXIS = (float(np.cos(TILT)), 0.0, float(np.sin(TILT)))
RACE = race_cost(load_course("split_s_swift"), 0.14, RaceWeights(), 1)
WEIGHT = 3.0


def view(cost, q, here):
    """(the view term, all others) of a step that ends at `here` with attitude q."""
    x = (*here, 0.0, 0.0, 0.0, *q, 0.0, 0.0, 0.0, 9.81, 0.0, 0.0, 0.0)
    found = cost.terms(x, x, (0.0, 0.0, 0.0, 9.81), tuple(cost.targets[0].tolist()), 0.0, cost.params)
    same = terms(x, x, (0.0, 0.0, 0.0, 9.81), tuple(cost.targets[0].tolist()), 0.0, RACE.params)
    assert found[:9] == same[:9]
    assert found[10:] == same[9:]
    return float(found[9])


@pytest.mark.parametrize(("turn", "share"), [(0.0, 0.0), (np.pi / 2, 1.0), (np.pi, 2.0)])
def test_the_angle_between_axis_and_bearing_costs(turn, share):
    """The vehicle stands so that the target lies on the optical axis, then looks aside by this angle."""
    cost, q = with_view(RACE, WEIGHT, AXIS), exp((0.1, -0.3, 0.8))
    here = cost.targets[0, :3] - 4.0 * (matrix(q) @ AXIS)
    about = np.array([0.0, 1.0, 0.0])  # the body's left, across the axis
    assert view(cost, product(q, exp(turn * about)), tuple(here.tolist())) == pytest.approx(share * WEIGHT, abs=1e-6)


def test_the_nose_is_the_bodys_x_axis():
    q = exp((0.4, -0.2, 1.0))
    np.testing.assert_allclose(nose(*q), matrix(q)[:, 0], atol=1e-12)


def test_it_has_a_lane_twin_of_its_own():
    source = lane_source(with_view(RACE, WEIGHT, AXIS).terms, "terms")
    assert {"terms", "terms_race_terms", "terms_nose", "terms_thrust_axis"} <= source.keys()


def test_it_is_flown_where_a_camera_is():
    spec = Spec.of("split_s_swift", sensing="gates", view_weight=2.0)
    cost = spec.entry.cost(spec)
    assert cost.term_names[-1] == "view"
    np.testing.assert_allclose(cost.params[-3:], (2.0, *AXIS[::2]))
    assert Spec.of("split_s_swift", sensing="gates").record().get("view_weight") is None
    with pytest.raises(SettingError, match="view_weight: expected a sensing with a camera, got mocap"):
        Spec.of("split_s_swift", sensing="mocap", view_weight=2.0)
