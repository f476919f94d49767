"""A stored estimate holds the others' paths, so it gives the same control again in any order."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from quadsim.config.build import planner_of
from quadsim.controllers.in_flight import PlannerInFlight
from quadsim.controllers.mppi import MPPI
from quadsim.heat.launch import heat_frames, keep_clear_terms, with_terms
from quadsim.heat.line_up import line_up
from quadsim.heat.spec import HeatSpec
from tests.small import SMALL

pytestmark = pytest.mark.compiled

SETTINGS = {**SMALL, "laps": 1, "first_iterations": 10, "keep": 2.0, "spacing": 0.5}


def arrays(estimate):
    """Return the numbers of an estimate, by name."""
    paths = {f"path of {m}": path.positions for m, path in estimate.others}
    return {"x": estimate.x, **paths}


@pytest.fixture(scope="module")
def raced():
    """Return a race of two, and the estimates of its first vehicle as they were and as stored."""
    entrants, settings = line_up("figure8", ["colored"] * 2, SETTINGS | {"stagger": 0.05})
    heat = HeatSpec(entrants, settings, seed=3)
    given, stored = [], []
    control = PlannerInFlight.control

    def noted(planner, estimate):
        # A start time tells the planners apart.
        if estimate.start_time == 0.0:
            given.append(estimate)
            stored.append(pickle.dumps(estimate))
        return control(planner, estimate)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PlannerInFlight, "control", noted)
        for frame in heat_frames(heat):
            if frame.t >= 0.25:
                break
    return heat, given, [pickle.loads(one) for one in stored]


def new_planner(heat) -> MPPI:
    """Return a new planner of the first vehicle."""
    return planner_of(with_terms(heat.flown_spec(0), keep_clear_terms(heat, 0)))


def controls(heat, estimates):
    """Return the control of a new planner at each estimate."""
    return [new_planner(heat).control(one)[0] for one in estimates]


def test_an_estimate_has_the_other_once_it_has_started_and_is_not_changed(raced):
    _, given, stored = raced
    assert [len(one.others) for one in given[::6]] == [0, 1, 1, 1, 1]
    for one, before in zip(given, stored, strict=True):
        assert arrays(one).keys() == arrays(before).keys()
        for name, value in arrays(one).items():
            np.testing.assert_array_equal(value, arrays(before)[name])


def test_a_stored_estimate_gives_the_same_control_again_and_in_another_order(raced):
    heat, given, stored = raced
    some = given[::6]
    first = controls(heat, some)
    again = controls(heat, stored[::6])
    backwards = controls(heat, stored[::6][::-1])[::-1]
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first, backwards)


def test_one_planner_forgets_the_others_of_the_estimate_before(raced):
    heat, given, _ = raced
    alone, beside = given[0], given[-1]
    planner = new_planner(heat)

    def cost(estimate):
        """Return the cost of hovering where the vehicle last was, beside these others."""
        planner.use_estimates(estimate)
        plan = planner.steps.mean(planner.plan)
        found = planner.rollout.trajectories(beside.x, plan.T[None], beside.target)
        return float(found.J[0])

    near, none = cost(beside), cost(alone)
    assert near > none
    assert [cost(beside), cost(alone), cost(beside)] == [near, none, near]


def test_a_planner_turns_from_its_course_for_the_others(raced):
    heat, given, _ = raced
    beside = given[-1]
    alone, clear = controls(heat, [replace(beside, others=()), beside])
    assert not np.array_equal(alone, clear)
