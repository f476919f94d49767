"""Gates that are known only from nearby are approached so that they can still be flown through."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from oracle import fly_rows, to_lanes

from quadsim.config.build_cost import cost_on
from quadsim.config.build_plant import system_of
from quadsim.config.spec import Spec
from quadsim.controllers.costs.race_caution import (
    CautiousTarget,
    out_of_reach,
    risk,
    share_of_sight,
    unseen_gates,
)
from quadsim.controllers.costs.race_targets import GateTarget
from quadsim.controllers.lanes.lanes import Rollout
from quadsim.controllers.lanes.planner_loops import module_source
from quadsim.course import load_course
from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.vehicle import GRAVITY, load_vehicle

COURSE = load_course("lsy_track")
MODEL = ModelParams.of(load_vehicle("cf21b_500"))
LEVEL = Spec.of(competition="lsy_level2", seed=3)
COST = cost_on(LEVEL, COURSE)
# Gate 4 is level and is flown through along x.
LAST = CautiousTarget(*COST.targets[-2])
HOVER = Control(0.0, 0.0, 0.0, GRAVITY)
KNOWN_FROM = 0.7  # [m]


def before(away, v=(2.0, 0.0, 0.0), aside=0.0, above=0.0, thrust=GRAVITY):
    """Return a level state in front of gate 4, at a horizontal distance from its middle."""
    x, y, z = COURSE.gates[3].position
    position = (x - np.sqrt(away**2 - aside**2), y + aside, z + above)
    return State.of(position, v, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, thrust, (0.0,) * 3)


def missed(v=(2.0, 0.0, 0.0), **place):
    """Return the probability of a miss where the gate becomes known."""
    return float(out_of_reach(before(KNOWN_FROM, v, **place), LAST, COST.params))


def fastest_without_risk():
    """Return the largest straight speed with which no place of the gate is out of reach [m/s]."""
    speeds = np.arange(2.0, 6.0, 0.01)
    return max(v for v in speeds if missed((float(v), 0.0, 0.0)) == 0.0)


def test_at_the_fastest_speed_without_risk_the_model_moves_as_far_aside_as_it_has_to():
    """With its own model, from level flight in the middle, to the furthest place of the gate."""
    dt = 0.001
    ahead = KNOWN_FROM - (LAST.depth / 2)
    seconds = ahead / fastest_without_risk() - LEVEL.planner.mppi.dt / 2
    system = quadrotor(MODEL, dt)
    x = before(KNOWN_FROM)
    begin = x.py
    roll = Control(MODEL.rate_max[0], 0.0, 0.0, MODEL.thrust_max)
    for _ in range(round(seconds / dt)):
        x = system.next(x, roll)
    aside = LEVEL.displacement.gates - LAST.free_y
    assert aside < begin - x.py < 2.5 * aside, "the law takes the lags for a time without motion"


def test_the_risk_grows_with_speed_slant_and_offset_from_the_middle():
    fast = fastest_without_risk() + 1.0
    assert 0.0 == missed((2.0, 0.0, 0.0)) < missed((fast, 0.0, 0.0)) < 1.0
    assert missed((fast, 0.0, 0.0), aside=0.05) > missed((fast, 0.0, 0.0))
    assert missed((3.0, 1.0, 0.0)) > 0.0, "a slanting path"
    assert missed((3.0, -1.0, 0.0), aside=0.2) < missed((3.0, 1.0, 0.0), aside=0.2), "to the middle"


def test_a_climb_can_only_be_ended_while_there_is_thrust_to_take_away():
    climb = (2.0, 0.0, 1.5)
    assert missed(climb, above=0.1, thrust=MODEL.thrust_min) > missed(climb, above=-0.2)
    assert missed((2.0, 0.0, 0.0), thrust=MODEL.thrust_max / 2) == 0.0


def test_beside_a_gate_and_behind_it_there_is_no_risk():
    x, y, z = COURSE.gates[3].position
    behind = before(KNOWN_FROM)._replace(px=x + 0.3, py=y, pz=z)
    assert float(out_of_reach(behind, LAST, COST.params)) == 0.0


def test_it_becomes_known_once_on_the_way_to_it():
    """What is left after each step, multiplied, is nothing, however the way is divided."""
    for steps in (3, 10, 50):
        places = [before(float(away)) for away in np.linspace(1.0, 0.3, steps)]
        shares = [share_of_sight(a, b, LAST, COST.params) for a, b in pairwise(places)]
        assert np.prod(1.0 - np.array(shares)) == pytest.approx(0.0, abs=0.05)
        assert max(shares) > 0.0
    away = share_of_sight(before(0.65), before(0.75), LAST, COST.params)
    assert away == 0.0, "nothing new is seen on the way back"


def test_a_gate_that_was_seen_has_no_risk():
    seen = replace(COURSE, gates=(*COURSE.gates[:3], LEVEL.flown_course.gates[3]))
    assert unseen_gates(COURSE, seen) == (True, True, True, False)
    cost = cost_on(LEVEL, seen)
    row = CautiousTarget(*cost.targets[-2])
    step = (before(0.72, (9.0, 0.0, 0.0)), before(0.6, (9.0, 0.0, 0.0)), HOVER)
    assert float(risk(*step, LAST, COST.params)) > 0.0
    assert float(risk(*step, row, cost.params)) == 0.0


def test_a_crash_counts_more_the_further_it_is_from_the_opening():
    def hit(aside):
        x, y, z = COURSE.gates[3].position
        a = before(KNOWN_FROM)._replace(px=x - 0.2, py=y + aside, pz=z)
        return float(risk(a, a._replace(px=x - 0.05), HOVER, LAST, COST.params))

    assert hit(0.0) == 0.0
    assert 0.0 < hit(LAST.free_y + 0.01) < hit(LAST.free_y + 0.05)


def test_the_text_of_the_lanes_has_the_risk():
    text = module_source(system_of(LEVEL), COST, np.float32)
    compile(text, "lanes", "exec")
    assert "risk" in text
    assert "risk" not in module_source(system_of(LEVEL), replace(COST, risk=None), np.float32)


# It takes some seconds to compile the loop.
@pytest.mark.regression
def test_the_lanes_add_the_risk_to_the_flag_as_the_oracle_does():
    """From in front of gate 4, with its frame and the poles; without the risk J is another."""
    T = LEVEL.planner.mppi.horizon
    system = system_of(LEVEL)
    x0 = np.array(before(1.0, (3.5, 0.3, 0.2)))
    z = np.random.default_rng(0).normal(0, 1, (256, 4, T)).astype(np.float32)
    z[:, 3] *= 3
    U = np.tile(system.rest, (T, 1))
    J = np.empty((4, 64), np.float32)
    Rollout(system, COST)(x0, U, to_lanes(z), 3, J)
    oracle = fly_rows(system, COST, x0, U, z, target=3)
    same = np.isclose(J.ravel(), oracle.J, rtol=1e-3, atol=1e-3)
    assert same.mean() > 0.95
    plain = fly_rows(system, replace(COST, risk=None), x0, U, z, target=3)
    assert np.isclose(plain.J, oracle.J, rtol=1e-3, atol=1e-3).mean() < 0.9


@pytest.mark.parametrize("without", [{"known_from": None}, {"caution": 0.0}])
def test_the_risk_does_not_exist_where_it_has_no_use(without):
    known = Spec.of(competition="lsy_level2", seed=3, **without)
    if "known_from" in without:
        known = replace(known, known_from=None)
    cost = cost_on(known, COURSE)
    assert cost.row is GateTarget
    assert cost.risk is None
