"""Steps of several control periods: the same laws of time as steps of one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from point import White

from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.costs import AmountTerm, Cost, Term
from quadsim.controllers.lanes.layout import from_lanes
from quadsim.controllers.lanes.sums import sums_of_steps
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.presets import contradictions, preset
from quadsim.controllers.samplers import Colored, Gaussian, LogNormal, SmoothStar, build_lanes
from quadsim.controllers.schedule import Schedule, marks_at, step_lengths
from quadsim.controllers.steps import Steps
from quadsim.dynamics.quadrotor import ModelParams, State, quadrotor
from quadsim.paper.integrator import double_integrator, quadratic_cost
from quadsim.vehicle import load_vehicle
from tests.small import SMALL

DT = 0.01
LENGTHS = step_lengths(150, DT, doubling=0.5)


def test_steps_double_after_the_given_time_up_to_40_ms_and_fill_the_horizon():
    assert sum(LENGTHS) == 150
    assert LENGTHS[:50] == (1,) * 50
    assert LENGTHS[50:75] == (2,) * 25
    assert LENGTHS[75:] == (4,) * 12 + (2,)
    assert step_lengths(150, DT, None) == step_lengths(150, DT, 1.5) == (1,) * 150
    assert set(step_lengths(300, DT, 0.5)) == {1, 2, 4}
    assert set(step_lengths(100, 0.02, 0.3)) == {1, 2}
    assert set(step_lengths(50, 0.04, 0.3)) == {1}


def test_weights_along_the_horizon_are_laws_of_time():
    """Each step has the sum of the weights of its periods, and the mean of their noise."""
    fine = Schedule(first_noise=0.3, cost_rise=2.0)
    longer = Schedule(first_noise=0.3, cost_rise=2.0, lengths=LENGTHS)
    T, ends = len(LENGTHS), np.cumsum(LENGTHS)
    # J is the sum of the weights times the costs, divided by the number of steps.
    np.testing.assert_allclose(
        np.cumsum(longer.cost(T)) / T, np.cumsum(fine.cost(150))[ends - 1] / 150
    )
    np.testing.assert_allclose(longer.noise(T)[0] @ LENGTHS, fine.noise(150)[0].sum())
    marks = longer.marks(T, 10)
    assert marks.sum() == pytest.approx(T)
    at = ends[np.flatnonzero(marks)]
    assert np.all(np.diff(at) >= 8)
    assert np.all(np.diff(at) <= 12)


def test_marks_are_where_a_number_of_periods_has_passed():
    assert marks_at((1,) * 10, 4).tolist() == [3, 7, 9]
    assert marks_at((1, 1, 2, 4, 4, 1), 4).tolist() == [2, 3, 4, 5]


def test_an_amount_counts_once_in_a_step_and_a_rate_for_each_period():
    def one(x, x_next, u, target, p):
        return 1.0

    terms = (AmountTerm(one, 6.0, "amount"), Term(one, 6.0, "rate"))
    cost = Cost("some", terms, State, np.zeros((1, len(State._fields))))
    longer = Schedule(lengths=(1, 1, 2, 4))
    rows = cost.numbers(4, lengths=longer.lengths)
    np.testing.assert_allclose(longer.cost(4) @ rows / 4 * 8, [6.0 * 4, 6.0 * 8])
    assert [np.max(term.weight) for term in cost.over(longer.lengths).terms] == [6.0, 6.0]
    np.testing.assert_allclose(
        cost.numbers(4, {"weight_amount": 12.0}, (1, 1, 2, 4))[:, 0], [12, 12, 6, 3]
    )


def test_a_plan_keeps_its_periods_and_each_step_learns_for_all_of_them():
    steps = Steps((1, 1, 2, 3))
    controls = np.arange(14.0).reshape(7, 2)
    np.testing.assert_allclose(steps.mean(controls), [[0, 1], [2, 3], [5, 6], [10, 11]])
    np.testing.assert_allclose(
        steps.mean(steps.in_periods(steps.mean(controls))), steps.mean(controls)
    )
    same = Steps((1,) * 7)
    assert same.mean(controls) is controls
    assert same.in_periods(controls) is controls


def test_a_solution_is_followed_in_control_periods():
    assert MPPIConfig(longer_steps=0.5, horizon=150, dt=DT).step_lengths == LENGTHS
    informed = preset("race_informed", "colored")
    changed = replace(informed, mppi=replace(informed.mppi, longer_steps=0.3))
    assert [key for key, _ in contradictions(changed)] == ["mppi.longer_steps"]
    assert not list(contradictions(informed))


def planner(sampler, longer_steps):
    """Return a planner of the double integrator with 1024 samples of a sampler."""
    system, cost = double_integrator(DT), quadratic_cost(goal=(1.0, 0.0))
    horizon = SMALL["horizon"]
    config = MPPIConfig(1024, horizon=horizon, dt=DT, longer_steps=longer_steps, target_ess=20)
    return MPPI(system, cost, sampler, config)


def noise_of(sampler, lengths, key):
    """Return the noise of all samples for each step, as the rollouts add it.  (M, n_u, T)"""
    source = build_lanes(sampler, 2, 1024, lengths, key, DT)
    return from_lanes(source.sample(1).copy(), 1024, len(lengths)).astype(float)


def means_over_steps(z):
    """Return the mean of noise (M, n_u, periods) over each step of LENGTHS.  (M, n_u, T)"""
    return Steps(LENGTHS).mean(z.swapaxes(1, 2)).swapaxes(1, 2)


@pytest.mark.compiled
@pytest.mark.parametrize(
    "sampler",
    [
        Colored((0.8, 2.0), (1.0, 1.0)),
        Colored((0.8, 2.0), (1.0, 1.0), law="library"),
        White((0.8, 2.0)),
    ],
)
def test_a_longer_step_has_the_mean_of_the_noise_of_its_periods(sampler, key):
    z, found = noise_of(sampler, (1,) * 150, key), noise_of(sampler, LENGTHS, key)
    np.testing.assert_allclose(found, means_over_steps(z), atol=1e-5)


@pytest.mark.compiled
def test_noise_with_a_cut_off_has_the_covariance_of_the_means_over_the_steps(key):
    """It is drawn at some periods only, so the numbers differ, but not how they vary."""
    sampler = Colored((0.8, 2.0), (0.8, 2.0), cutoff=(5.0, 5.0))
    z, found = noise_of(sampler, (1,) * 150, key), noise_of(sampler, LENGTHS, key)
    means = means_over_steps(z)
    for control in range(2):
        wanted, got = np.cov(means[:, control].T), np.cov(found[:, control].T)
        # five standard errors of two sets of 1024 samples
        assert abs(got - wanted).max() < 5 * np.sqrt(2 * 2 / 1024) * wanted.max()


@pytest.mark.compiled
@pytest.mark.parametrize("sampler", [Gaussian((0.8, 2.0)), LogNormal((0.3, 0.4))])
def test_white_noise_of_a_longer_step_varies_as_the_mean_of_its_periods(sampler, key):
    z, found = noise_of(sampler, (1,) * 150, key), noise_of(sampler, LENGTHS, key)
    means = means_over_steps(z)
    for step in (slice(0, 50), slice(50, 75), slice(75, 87)):
        wanted = means[:, :, step].std(axis=(0, 2))
        np.testing.assert_allclose(found[:, :, step].std(axis=(0, 2)), wanted, rtol=0.06)


def test_noise_known_at_some_periods_is_summed_to_the_mean_over_a_step():
    """Without high frequencies a few numbers around a step are enough, and the first ones follow
    the last ones of the periodic series."""
    n, every, steps = 60, 3, Steps((1, 1, 2, 4, 2))
    power = np.where(np.minimum(np.arange(n), n - np.arange(n)) < 6, 1.0, 0.0)[None]
    sums = sums_of_steps(power, steps, halves=2, every=every)
    rng, k = np.random.default_rng(0), np.arange(n)
    waves = np.exp(2j * np.pi * np.outer(k, k) / n) * np.sqrt(power[0])
    z = rng.normal(size=(500, n)) @ waves.T.real - rng.normal(size=(500, n)) @ waves.T.imag
    found = np.einsum("tj,mtj->mt", sums.parts[0], z[:, ::every][:, sums.at])
    means = steps.mean(z[:, :10, None])[:, :, 0]
    assert (found[:, :5] - means).std() < 0.02 * means.std()


@pytest.mark.compiled
@pytest.mark.parametrize(
    "sampler",
    [
        Gaussian((1.0, 1.0)),
        Colored((1.0, 1.0), (1.0, 1.0), cutoff=(5.0, 5.0)),
        LogNormal((0.6, 0.6)),
        SmoothStar((0.6, 0.6)),
    ],
)
def test_every_sampler_reaches_the_goal_with_longer_steps(sampler):
    mppi, x = planner(sampler, 0.12), np.array([0.0, 0.5, 0.0, 0.0])
    for _ in range(200):
        u, _ = mppi.control(x)
        x = np.array(mppi.system.next(x, u))
    assert np.hypot(x[0] - 1.0, x[1]) < 0.1


def flown(system, x, u, seconds):
    """Return the state after some seconds of a constant command."""
    for _ in range(round(seconds / system.dt)):
        x = system.next(x, u)
    return x


@pytest.mark.parametrize("vehicle", ["swift", "cpc", "flightmare", "crazyflie"])
@pytest.mark.parametrize("periods", [2, 4])
def test_a_step_of_several_periods_is_several_steps(vehicle, periods):
    """Lags are exact: thrust and body rates after a commanded change, from steady flight."""
    model = ModelParams.of(load_vehicle(vehicle))
    fine = quadrotor(model, DT)
    longer = fine.over(periods)
    rest = State.of((0, 0, 9), (8, 0, 0), (1, 0, 0, 0), (0, 0, 0), 9.81, (0, 0, 0))
    low = min(model.rate_max)
    u = fine.control(0.1 * low, -0.1 * low, 0.05 * low, 0.6 * model.thrust_max)
    one, several = longer.next(rest, u), flown(fine, rest, u, periods * DT)
    assert one.thrust == pytest.approx(several.thrust)
    np.testing.assert_allclose(one.body_rates, several.body_rates, rtol=1e-9)
    # Over a third of a second the paths stay together.
    apart = np.subtract(flown(longer, rest, u, 0.32).position, flown(fine, rest, u, 0.32).position)
    assert np.linalg.norm(apart) < 0.03 * periods
