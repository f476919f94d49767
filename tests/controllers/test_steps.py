"""Steps of several control periods: the same laws of time as steps of one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.costs import AmountTerm, Cost, Term
from quadsim.controllers.lanes.layout import from_lanes
from quadsim.controllers.mppi import MPPI
from quadsim.controllers.presets import contradictions, preset
from quadsim.controllers.samplers import Colored, Gaussian, LogNormal, SmoothStar
from quadsim.controllers.schedule import Schedule, first_periods, marks_at, step_lengths
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


def noise_of_steps(mppi):
    """Return the noise of all samples for each step, as the rollouts add it.  (M, n_u, T)"""
    z = from_lanes(mppi.sampler.sample(1).copy(), 1024, SMALL["horizon"])
    return z[:, :, mppi.draws] * mppi.ramp[1]


@pytest.mark.compiled
@pytest.mark.parametrize(
    "sampler",
    [
        Gaussian((0.8, 2.0)),
        Colored((0.8, 2.0), (0.8, 2.0), cutoff=(5.0, 5.0)),
        Colored((0.8, 2.0), (1.0, 1.0)),
    ],
)
def test_noise_of_a_longer_step_varies_as_the_mean_of_its_periods(sampler):
    lengths = step_lengths(SMALL["horizon"], DT, doubling=0.12)
    assert lengths == (1,) * 12 + (2,) * 6 + (4,) * 4
    fine, longer = planner(sampler, None), planner(sampler, 0.12)
    z = noise_of_steps(fine)
    found = noise_of_steps(longer).std(axis=(0,))
    means = np.add.reduceat(z, first_periods(lengths), axis=2) / np.array(lengths)
    for step in (slice(0, 12), slice(12, 18), slice(18, 22)):
        wanted = means[:, :, step].std(axis=(0, 2))
        np.testing.assert_allclose(found[:, step].mean(axis=1), wanted, rtol=0.06)


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
