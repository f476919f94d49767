"""The weights of MPPI, their effective sample size, and the temperature that is solved for one."""

import numpy as np
import pytest
from point import START, make

from quadsim.controllers.update import TEMPERATURE_RANGE, solve_temperature, weights


def test_effective_sample_size_counts_equal_samples():
    def ess(J, temperature=1.0):
        return 1 / np.sum(weights(np.array(J), temperature) ** 2)

    assert ess([2.0] * 50) == pytest.approx(50)
    assert ess([0.0, 0.0, 1e3, 1e3]) == pytest.approx(2)
    assert ess(np.arange(100.0), 1e-3) == pytest.approx(1)


def test_weights_survive_huge_costs_and_overflowed_rollouts():
    np.testing.assert_array_equal(
        weights(np.array([1e30, 3e38, np.inf, np.nan]), 0.3), [1.0, 0.0, 0.0, 0.0]
    )
    np.testing.assert_allclose(
        weights(np.array([1e6, 1e6 + 0.3]), 0.3), np.array([1, np.exp(-1)]) / (1 + np.exp(-1))
    )
    with pytest.raises(FloatingPointError, match="expected a finite J in one of 2 rollouts"):
        weights(np.array([np.inf, np.nan]), 0.3)


@pytest.mark.parametrize("start", [1e-4, 0.3, 1e4])
@pytest.mark.parametrize("scale", [1e-2, 1.0, 100.0])
@pytest.mark.parametrize("target", [2.0, 20.0, 600.0])
def test_a_solved_temperature_has_the_effective_sample_size_asked_for(start, scale, target):
    J = np.random.default_rng(0).gamma(2.0, scale, 1024)
    solved = solve_temperature(J, target, start)
    assert 1 / np.sum(weights(J, solved) ** 2) == pytest.approx(target, rel=0.02)
    # the solution does not depend on the start, but within the tolerance
    assert solved == pytest.approx(solve_temperature(J, target, 1.0), rel=0.05)


def test_costs_that_have_no_temperature_end_at_the_range_or_leave_it_as_it_is():
    low, high = TEMPERATURE_RANGE
    assert solve_temperature(np.array([np.inf, np.nan]), 2.0, 0.3) == 0.3
    assert low <= solve_temperature(np.ones(64), 8.0, 0.3) <= high
    assert solve_temperature(np.arange(64.0) * 1e9, 8.0, 0.3) == pytest.approx(high, rel=0.01)
    with_crashes = np.array([*np.linspace(1.0, 2.0, 60), np.inf, np.inf, np.nan, 1e30])
    solved = solve_temperature(with_crashes, 10.0, 0.3)
    assert 1 / np.sum(weights(with_crashes, solved) ** 2) == pytest.approx(10, rel=0.02)


@pytest.mark.compiled
def test_each_plan_with_a_solved_temperature_has_its_effective_sample_size_at_once():
    """It is target_ess sqrt(M / 1024): half of target_ess with 256 samples."""
    mppi = make(samples=256, target_ess=40.0, temperature=1e-3)
    sizes = [mppi.iterate(START, 0).ess for _ in range(20)]
    assert sizes == pytest.approx([20.0] * 20, rel=0.02)
