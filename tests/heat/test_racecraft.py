"""Rules for a vehicle ahead: patience that is lost behind it, and samples that pass it."""

from types import SimpleNamespace

import numpy as np
import pytest

import quadsim
from controllers.lanes import layout
from quadsim.dynamics.estimate import Estimate
from quadsim.heat.aware_planner import CLOSE, Eyes
from quadsim.heat.patience import Patience
from quadsim.heat.sides import Sides, pulse_to_left
from quadsim.racing.traffic import Sighting
from quadsim.spec.build import planner_of


def test_patience_is_lost_behind_a_vehicle_and_comes_back_when_that_is_past():
    patience = Patience(1.0)
    times = iter(np.arange(0.0, 10.0, 0.25))

    def shares(count, follows):
        return [patience.share(1, next(times), follows) for _ in range(count)]

    assert shares(6, follows=True) == [1.0, 0.875, 0.75, 0.625, 0.5, 0.5]
    assert patience.share(2, 1.25, follows=True) == 1.0  # it is lost behind one vehicle alone
    assert shares(5, follows=False) == [0.625, 0.75, 0.875, 1.0, 1.0]


def seen_from_the_start(ahead, passed=0):
    """Return whether a vehicle [m] nearer to gate 1 is followed."""
    course = quadsim.load_course("split_s_swift")
    gate = np.array(course.gates[0].position)
    here = np.array(course.start.position)
    to_gate = (gate - here) / np.linalg.norm(gate - here)
    there = tuple((here + ahead * to_gate).tolist())
    seen = Sighting(0.0, there, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), passed)
    eyes = Eyes(0, SimpleNamespace(), 0.0, course)
    return eyes.follows(seen, Estimate(0.0, np.array([*here, *[0.0] * 14]), 1))


@pytest.mark.parametrize(
    ("ahead", "passed", "follows"),
    [(1.0, 1, True), (-1.0, 1, False), (CLOSE + 0.1, 1, False), (1.0, 0, False), (-1.0, 2, True)],
)
def test_a_vehicle_is_followed_that_is_near_and_has_come_farther(ahead, passed, follows):
    assert seen_from_the_start(ahead, passed) is follows


def planner_at_rest():
    """Return a planner that has not planned, and a state 5 m above the start."""
    spec = quadsim.Spec.of("split_s_swift", samples=256)
    planner = planner_of(spec)
    x = np.zeros(len(planner.system.states))
    x[:3] = -5.0, 4.7, 5.0
    x[planner.system.states.index("qw")] = 1.0
    return planner, x


@pytest.mark.flight
def test_a_pulse_displaces_the_path_to_the_left_and_leaves_its_direction():
    planner, x = planner_at_rest()
    v = np.stack([planner.plan.T] * 2)  # (2, n_u, T)
    v[1, 0] += pulse_to_left(planner, 0.6)
    (plain, displaced), _ = planner.rollout.paths(x, v, 0)
    aside = displaced[:, 1] - plain[:, 1]  # it faces along x  (T,)
    assert aside[80:] == pytest.approx(0.6, abs=0.12)
    assert np.ptp(aside[80:]) < 0.06


@pytest.mark.flight
def test_a_share_of_the_samples_passes_on_either_side_where_a_vehicle_is_ahead():
    planner, _ = planner_at_rest()
    before = planner.sampler.sample(1).copy()
    sides = Sides(share=0.5, aside=0.6)
    sides.offer(planner, wanted=False)
    np.testing.assert_array_equal(planner.sampler.sample(1), before)

    sides.offer(planner, wanted=True)
    pulse = pulse_to_left(planner, 0.6)
    T = planner.config.horizon
    added = planner.sampler.sample(1) - before
    assert not added[:, 1:].any()  # other controls than the roll rate
    for b in range(4):
        of_block = layout.block(added, b, T)[0] * planner.ramp[b % 2][:, None]  # (T, LANES)
        assert of_block[:, 1:17] == pytest.approx(np.tile(pulse, (16, 1)).T, abs=1e-5)
        assert of_block[:, 17:33] == pytest.approx(np.tile(-pulse, (16, 1)).T, abs=1e-5)
        assert not of_block[:, [0, *range(33, layout.LANES)]].any()
