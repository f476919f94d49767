"""Gates that are known only from nearby are approached no faster than they can still be reached."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.config.build_cost import cost_on
from quadsim.config.spec import Spec
from quadsim.controllers.costs import evaluate
from quadsim.controllers.costs.race_caution import REACH, safe_speed, with_unseen
from quadsim.controllers.costs.race_targets import GateTarget
from quadsim.course import EstimatedGate, load_course
from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.vehicle import GRAVITY, load_vehicle

COURSE = load_course("lsy_track")
VEHICLE = load_vehicle("cf21b_500")
MODEL = ModelParams.of(VEHICLE)
CASE = {"radius": VEHICLE.radius, "model": MODEL, "period": 0.02, "spread": 0.15, "known_from": 0.7}
LEVEL = Spec.of(competition="lsy_level2", seed=3)
HOVER = Control(0.0, 0.0, 0.0, GRAVITY)


def speed(**changes):
    return safe_speed(COURSE, **{**CASE, **changes})


def test_at_the_safe_speed_the_vehicle_can_still_move_aside():
    """With its own model, from level flight: it moves by what the opening does not leave it."""
    dt = 0.001
    distance = CASE["known_from"] - (0.01 + VEHICLE.radius)
    seconds = distance / speed(period=0.0)
    system = quadrotor(MODEL, dt)
    x = State.of((0, 0, 0), (0, 0, 0), (1, 0, 0, 0), (0, 0, 0), MODEL.thrust_max, (0, 0, 0))
    roll = Control(MODEL.rate_max[0], 0.0, 0.0, MODEL.thrust_max)
    for _ in range(round(seconds / dt)):
        x = system.next(x, roll)
    free = GateTarget(*cost_on(replace(LEVEL, known_from=None), COURSE).targets[0]).free_y
    aside = CASE["spread"] - free
    assert aside < -x.py < 2 * aside, "the law takes the lags for a time without motion"


def test_the_safe_speed_grows_with_sight_and_falls_with_displacement_and_lag():
    assert speed(known_from=1.0) > speed() > speed(spread=0.2)
    assert speed() > speed(period=0.05)
    slow = replace(MODEL, rate_tau=(0.1, 0.1, 0.1))
    assert speed() > speed(model=slow)
    assert speed(spread=0.1) == np.inf, "the openings have room for that"


def pays(gate, v, away, course=COURSE):
    """Return what a step pays at a gate of a course, at a speed and a horizontal distance."""
    cost = cost_on(LEVEL, course)
    x, y, z = course.gates[gate].position
    state = State.of((x - away, y, z), (v, 0, 0), (1, 0, 0, 0), (0, 0, 0), GRAVITY, (0, 0, 0))
    rows = cost.targets[-1 - len(course.gates) :]
    return evaluate(cost, state, state, HOVER, rows[gate]).terms["caution"]


def test_speed_above_it_costs_near_a_gate_that_nobody_has_seen():
    v, weight = speed(), LEVEL.planner.cost.caution
    near, far = 0.99 * REACH * 0.7, 1.01 * REACH * 0.7
    assert pays(3, v + 1.0, near) == pytest.approx(weight, rel=1e-3)
    assert pays(3, v - 0.1, near) == 0.0
    assert pays(3, v + 1.0, far) == 0.0


def test_a_gate_that_was_seen_is_flown_as_any_other():
    seen = replace(COURSE, gates=(*COURSE.gates[:3], LEVEL.flown_course.gates[3]))
    assert pays(3, 10.0, 0.5, seen) == 0.0
    assert pays(2, 10.0, 0.5, seen) > 0.0
    margins = [GateTarget(*row[:20]).margin for row in cost_on(LEVEL, seen).targets[-5:-1]]
    assert margins[2] > margins[3], "and the middle of the others' openings is kept to"
    kinds = [isinstance(gate, EstimatedGate) for gate in with_unseen(COURSE, seen, 0.15).gates]
    assert kinds == [True, True, True, False]


@pytest.mark.parametrize("without", [{"known_from": None}, {"caution": 0.0}])
def test_the_term_does_not_exist_where_it_has_no_use(without):
    known = Spec.of(competition="lsy_level2", seed=3, **without)
    if "known_from" in without:
        known = replace(known, known_from=None)
    assert cost_on(known, COURSE).row is GateTarget
    assert "caution" not in cost_on(known, COURSE).term_names
