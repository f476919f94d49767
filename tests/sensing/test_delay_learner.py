"""A delay of the commands that nobody has told is found, and nothing else is taken for one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from quadsim.course import load_course
from quadsim.dynamics.first_order import response
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.physics.domain_randomization import Randomization
from quadsim.physics.plant import RigidPlant
from quadsim.sensing.estimation.delay_learner import DelayLearner
from quadsim.sensing.estimation.prediction import Commands
from quadsim.sensing.navigation import Navigation, RefereeCount, TrueState
from tests.sensing.random_flights import SWIFT, Ways, flown, weak

REST = (0.0, 0.0, 0.0, 9.81)


def delays(ways, seconds, seed=0, gyro_noise=0.0):
    """Return the delay in use after each control period of a flight [s]."""
    learner = DelayLearner(ModelParams.of(SWIFT), 0.01)
    rng = np.random.default_rng(seed)
    found = []
    for _, after, u in flown(SWIFT, ways, seconds, seed=seed):
        rates = np.array(after.body_rates) + gyro_noise * rng.standard_normal(3)
        learner.learn(tuple(rates), u.body_rates)
        found.append(learner.delay)
    return found


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("gyro_noise", [0.0, 0.01])
@pytest.mark.parametrize("delay", [0.03, 0.04, 0.06, 0.08])
def test_an_unknown_delay_is_found_within_half_a_second(delay, gyro_noise, seed):
    found = delays(Ways(delay=delay), 1.0, seed, gyro_noise)
    assert found[50:] == pytest.approx([delay] * 50, abs=0.0101)


@pytest.mark.parametrize("seed", range(4))
def test_a_delay_that_ends_is_forgotten(seed):
    found = delays(Ways(delay=0.06, delayed_until=1.0), 2.0, seed)
    assert found[90] == pytest.approx(0.06)
    assert found[-1] == 0.0


@pytest.mark.parametrize("start", [1.0, 1.05])
@pytest.mark.parametrize("lasts", [0.2, 0.4])
def test_lost_commands_are_not_taken_for_late_ones(start, lasts):
    """Meanwhile the last command becomes older, as if the delay was growing."""
    for seed in range(3):
        assert not any(delays(Ways(lost=(start, start + lasts)), 2.0, seed))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(
    "ways",
    [
        Ways(weak(1, 0.7)),
        Ways(always=(3.0, -3.0, 5.0)),
        Ways(turn=(1.0, 1.0, 0.0)),
        Ways(varied=Randomization(rate_lag=0.2, motor_lag=0.2)),
        Ways(varied=Randomization(rate_lag=-0.2, motor_lag=-0.2)),
        Ways(lost=(1.0, 1.3)),
    ],
)
def test_nothing_else_is_taken_for_a_delay(ways, seed):
    assert not any(delays(ways, 2.0, seed, gyro_noise=0.02))


@pytest.mark.parametrize(("late", "found"), [(0, 0.0), (1, 0.0), (2, 0.05), (3, 0.075)])
def test_at_a_slow_rate_a_delay_of_one_control_period_does_not_count(late, found):
    """The samples of a gyroscope may be as old, and look like a delay."""
    dt = 0.025
    model = ModelParams.of(SWIFT)
    learner = DelayLearner(model, dt)
    k_rate = response(model.rate_tau[0], dt) / dt
    k_lag = response(model.rate_lags[0], dt)
    rng = np.random.default_rng(0)
    rates = [np.zeros(3)]
    acceleration = np.zeros(3)
    for _ in range(80):
        commanded = 3.0 * rng.standard_normal(3)
        acceleration = acceleration + k_lag * (k_rate * (commanded - rates[-1]) - acceleration)
        rates.append(rates[-1] + dt * acceleration)
        learner.learn(tuple(rates[max(len(rates) - 1 - late, 0)]), tuple(commanded))
    assert learner.delay == pytest.approx(found)


def test_after_the_delay_is_found_the_state_is_predicted_to_when_a_control_acts():
    """The plant is 40 ms late, of which the navigation was told nothing."""
    plant = RigidPlant(load_course("split_s_swift"), replace(SWIFT, latency=0.04))
    model = ModelParams.of(SWIFT)
    navigation = Navigation(
        TrueState(plant.state, 0.01),
        RefereeCount(SimpleNamespace(passed=0)),
        Commands(REST, latency=0.0),
        0.01,
        model,
        delay=DelayLearner(model, 0.01),
    )
    predicted, flown_states = [], []
    for k in range(80):
        t = plant.state.t
        estimate = navigation.estimate(t)
        predicted.append(estimate.x[:6])
        flown_states.append(plant.state.x[:6])
        u = (3.0 * np.sin(0.6 * k), 2.0 * np.cos(0.5 * k), 0.5, 25.0)
        navigation.commanded(t, t, u)
        for _ in range(4):
            navigation.watch(plant.step(u))
    late = np.linalg.norm(np.subtract(predicted[40:76], flown_states[40:76]), axis=1)
    off = np.linalg.norm(np.subtract(predicted[40:76], flown_states[44:]), axis=1)
    assert np.mean(off) < 0.1 * np.mean(late)
