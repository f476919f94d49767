"""The deadline: fewer samples after a plan that took too long, more after a quick one, in whole
blocks of lanes."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from quadsim.controllers.in_flight import PlannerInFlight
from quadsim.controllers.lanes.layout import LANES
from quadsim.dynamics.estimate import Estimate

MOST = 32 * LANES


class FakeMPPI:
    """A plan takes a fixed time for each sample, and its first one a second more."""

    def __init__(self, ms_per_sample, samples=MOST):
        self.config, self.samples = SimpleNamespace(samples=MOST), samples
        self.seconds, self.ms_per_sample, self._calls = 0.0, ms_per_sample, 0

    def control(self, known):
        self.seconds += 1e-3 * self.ms_per_sample * self.samples + (self._calls == 0)
        self._calls += 1
        return np.zeros(4), None


def samples_after(mppi, plans, deadline_ms=10.0):
    """Numbers of samples after each of the plans."""
    planner = PlannerInFlight(
        mppi, numbers=None, make=None, deadline_ms=deadline_ms, time=lambda: mppi.seconds
    )
    counts = []
    for t in range(plans):
        planner.control(Estimate(float(t), np.zeros(17)))
        counts.append(mppi.samples)
    return counts


def test_samples_shrink_until_a_plan_holds_the_deadline_and_stay_there():
    counts = samples_after(FakeMPPI(9.5 / (MOST / 2)), 20)
    assert counts[0] == MOST, "the first plan may have had to compile: it does not count"
    assert counts[1] < MOST
    assert all(a >= b for a, b in pairwise(counts))
    assert 0.8 * MOST / 2 <= counts[-1] == counts[-5] <= MOST / 2
    assert all(count % LANES == 0 for count in counts)


def test_samples_grow_again_when_plans_are_quick_but_not_beyond_the_configuration():
    counts = samples_after(FakeMPPI(1e-6, samples=8 * LANES), 60)
    assert counts[1] == 9 * LANES
    assert counts[-1] == MOST


@pytest.mark.parametrize("samples", [MOST, 2 * LANES])
def test_a_deadline_that_cannot_be_held_leaves_one_block_of_lanes(samples):
    assert samples_after(FakeMPPI(1.0, samples), 40)[-1] == LANES


def test_between_four_fifths_of_the_deadline_and_the_deadline_nothing_changes():
    at = 10 * LANES
    assert set(samples_after(FakeMPPI(9.0 / at, at), 10)) == {at}
