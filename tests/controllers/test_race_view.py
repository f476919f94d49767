"""The view term: nothing where the nose points where the vehicle flies, twice the weight where it
points back."""

import numpy as np
import pytest

from quadsim.config.build_cost import cost_on
from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
from quadsim.controllers.costs import evaluate
from quadsim.controllers.costs.race import RaceWeights, race_cost
from quadsim.controllers.costs.race_view import with_view
from quadsim.controllers.lanes.planner_loops import module_source
from quadsim.course import load_course
from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.rotation import exp, matrix, product
from quadsim.vehicle import load_vehicle

RACE = race_cost(load_course("split_s_swift"), 0.14, RaceWeights(), 1)
WEIGHT = 3.0
HOVER = Control(0.0, 0.0, 0.0, 9.81)
FAST = 1e3  # [m/s] at which the one in the root is nothing


def view(q, v):
    """The view term of a step that ends with attitude q and velocity v; all others are the racing
    cost's."""
    cost = with_view(RACE, WEIGHT)
    x = State.of((-2.0, 1.0, 2.0), v, q, (0.0, 0.0, 0.0), 9.81, (0.0, 0.0, 0.0))
    found, race = (evaluate(c, x, x, HOVER, c.targets[0]) for c in (cost, RACE))
    assert found.terms == {**race.terms, "view": found.terms["view"]}
    assert (found.reached, found.crashed) == (race.reached, race.crashed)
    return float(found.terms["view"])


@pytest.mark.parametrize(
    ("turn", "share"), [(0.0, 0.0), (np.pi / 2, 1.0), (-np.pi / 2, 1.0), (np.pi, 2.0)]
)
def test_the_angle_between_nose_and_velocity_about_the_bodys_z_axis_costs(turn, share):
    q = exp((0.1, -0.3, 0.8))
    v = FAST * matrix(q)[:, 0]
    assert view(product(q, exp((0.0, 0.0, turn))), tuple(v)) == pytest.approx(
        share * WEIGHT, abs=1e-3
    )


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_what_yaw_cannot_change_costs_nothing(axis):
    """A velocity along the body's z axis, and one that pitch alone has turned out of the x axis."""
    q = exp((0.4, -0.2, 1.0))
    v = FAST * matrix(q)[:, axis]
    assert view(q, tuple(v)) == pytest.approx(WEIGHT if axis == 1 else 0.0, abs=2e-3)
    pitched = product(q, exp((0.0, 0.7, 0.0)))
    assert view(pitched, tuple(FAST * matrix(q)[:, 0])) == pytest.approx(0.0, abs=2e-3)


def test_at_rest_it_costs_nothing():
    assert view(exp((0.0, 0.0, 2.0)), (0.0, 0.0, 0.0)) == pytest.approx(0.0, abs=WEIGHT * 2e-3)


def test_the_lanes_compute_it_where_it_has_a_weight_alone():
    """By its own lines beside those of the racing cost, which stay as they are."""
    system = quadrotor(ModelParams.of(load_vehicle("swift")), 0.01)
    race, seen, blind = (
        module_source(system, c, np.float32)
        for c in (RACE, with_view(RACE, 3.0), with_view(RACE, 0))
    )
    assert "# term: view" in seen
    assert "weight_view" in seen
    assert "view" not in blind + race

    def computed(source):
        lines = (line.strip() for line in source.splitlines())
        return {line for line in lines if " = " in line and "cost_numbers[" not in line}

    assert computed(race) == computed(blind) < computed(seen)


def test_it_is_flown_where_a_camera_has_to_find_gates():
    spec = Spec.of("split_s_swift", sensing="gates", view_weight=2.0)
    cost = cost_on(spec, spec.course)
    assert cost.term_names[-1] == "view"
    assert cost.terms[-1].weight == 2.0
    assert Spec.of("split_s_swift", sensing="gates").view_weight == 0.0
    displaced = {"sensing": "gates", "displace_gates": 0.15}
    assert Spec.of("split_s_swift", **displaced).view_weight == 1.0
    assert Spec.of("split_s_swift", **displaced, view_weight=0.0).view_weight == 0.0
    small = Spec.of("lsy_level2", vehicle="crazyflie", **displaced)
    assert small.view_weight == 0.0, "gates are a metre apart, and the nose lags"
    assert small.but(view_weight=0.5).view_weight == 0.5
    with pytest.raises(
        SettingError, match="view_weight: expected a sensing with a camera, got mocap"
    ):
        Spec.of("split_s_swift", sensing="mocap", view_weight=2.0)
