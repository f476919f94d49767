"""Laws of the parts of a fit: lag behind a delay, torques of the air, intervals, sampling."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.identify import fit_vehicle
from quadsim.identify.fit import remarks_on_attitude
from quadsim.identify.geometry import Geometry
from quadsim.identify.intervals import covariances
from quadsim.identify.numbers import FitNumbers
from quadsim.identify.prediction import Prediction
from quadsim.identify.prepared import prepare
from quadsim.identify.prior import prior_of
from quadsim.identify.problem import RATE_PIECE, blocks_of, single_thrusts
from quadsim.identify.rate_loop import fit_rate_loop
from quadsim.identify.rotors import lagged
from quadsim.identify.search import Linearized
from quadsim.identify.stretches import stretches
from quadsim.vehicle import load_vehicle
from tests.identify.fit_cases import TRUE, flight, noisy


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.0137, -0.006])
def test_a_lag_behind_a_delay_is_that_of_much_smaller_steps(delay):
    rng = np.random.default_rng(0)
    command = rng.uniform(size=200)
    dt, tau, fine = 0.01, 0.033, 1000
    answer = lagged(command, dt, tau, delay)
    # The same with held commands in steps of 10 us, in which all delays are whole.
    index = np.arange(len(command) * fine) - round(delay / dt * fine)
    held = command[np.clip(index // fine, 0, len(command) - 1)]
    slow = [held[0]]
    keep = np.exp(-dt / fine / tau)
    for value in held[:-1]:
        slow.append(value + keep * (slow[-1] - value))
    assert answer == pytest.approx(np.array(slow)[::fine], abs=1e-9)


def test_commands_between_the_rows_of_a_log_widen_the_intervals():
    """The rate loop of cf21b_500 lags by 6 ms; a row of the log takes 5 ms."""
    vehicle = load_vehicle("cf21b_500")
    found = fit_vehicle([noisy(flight(vehicle=vehicle))], mass=vehicle.mass)
    tau = found["rotors.motor_tau"]
    true = vehicle.rotors.motor_tau
    assert abs(tau.value / true - 1.0) > 0.03, "the log lacks commands"
    assert tau.low < true < tau.high
    every = fit_vehicle([noisy(flight(vehicle=vehicle, every=1))], mass=vehicle.mass)
    assert every["rotors.motor_tau"].std < 0.3 * tau.std


def test_a_simulated_attitude_that_loses_against_constant_velocity_is_said():
    row = Prediction("flight", 0.1, 9, 0.01, 0.02, 0.05, 0.1, 0.1)
    later = row._replace(seconds=0.5, simulated_attitude=0.6)
    latest = row._replace(seconds=1.0, simulated_attitude=2.0)
    assert list(remarks_on_attitude([row])) == []
    assert list(remarks_on_attitude([])) == []
    unknown = row._replace(simulated_attitude=None)
    assert list(remarks_on_attitude([unknown])) == []
    (remark,) = remarks_on_attitude([row, later, latest])
    assert "worse than constant velocity after 0.5 s" in remark


def line(rng, count, together):
    """Return the linearized fit of a constant 0 to noise, equal within each `together` values."""
    noise = np.repeat(rng.standard_normal(count // together), together)
    fitted = noise - noise.mean()
    cluster = np.arange(count) // together
    ones = np.ones((count, 1))
    return noise.mean(), Linearized(ones, fitted, cluster, np.array([1e-12]))


def covered(together):
    """Return the shares of intervals that cover 0: by the Jacobian alone, and as reported."""
    rng = np.random.default_rng(1)
    hits = np.zeros(2)
    tries = 100
    for _ in range(tries):
        mean, linearized = line(rng, 160, together)
        found = covariances(linearized)
        for k, covariance in enumerate((found.jacobian, found.reported)):
            hits[k] += abs(mean) < 1.96 * np.sqrt(covariance[0, 0])
    return hits / tries


def test_intervals_cover_the_truth_if_residuals_are_not_independent():
    by_jacobian, reported = covered(together=8)
    assert reported > 0.9
    assert by_jacobian < 0.7, "the control: the Jacobian alone takes residuals as independent"


def test_intervals_of_independent_residuals_cover_the_truth():
    by_jacobian, reported = covered(together=1)
    assert by_jacobian > 0.9
    assert reported >= by_jacobian


def test_a_constant_torque_of_the_air_changes_no_residual_of_the_body_rates():
    calm = flight()
    push = 0.5  # [rad/s^2], a torque about x over the inertia
    pushed = replace(calm, body_rates=calm.body_rates + push * calm.t[:, None] * (1.0, 0.0, 0.0))
    before, after = (rate_residuals(log) for log in (calm, pushed))
    # A free begin alone would leave the slope of each piece, which has this size at its ends.
    assert np.abs(after - before).max() < 0.01 * push * RATE_PIECE / 2.0
    assert np.std(before) > 0.0


def rate_residuals(log):
    """Return measured minus predicted body rates of the prior vehicle about x."""
    vehicle = load_vehicle("swift")
    parts = prepare(stretches(log), vehicle)
    (block,) = (b for b in blocks_of(parts, turning=(0,)) if b.channel.name == "rate")
    prior = prior_of(vehicle)
    numbers = FitNumbers(**{name: prior[name].mean for name in FitNumbers._fields})
    return block.residuals(numbers, Geometry.of(vehicle), single_thrusts(parts[0], numbers))


@pytest.mark.slow
@pytest.mark.parametrize("rows", [1, pytest.param(2, marks=pytest.mark.regression)])
def test_lags_of_the_rate_loop_do_not_depend_on_the_rate_of_the_log(rows):
    """At 100 Hz, taking a row as one step of the loop would find a lag of 60 ms 6 % low."""
    log = flight()
    count = len(log.t[::rows])
    signals = {
        name: values[::rows]
        for name in ("t", *log.signals)
        if (values := getattr(log, name)) is not None
    }
    thin = replace(log, **signals, pieces=(slice(0, count),))
    prior = load_vehicle("swift")
    found = fit_rate_loop(prepare(stretches(thin), prior), TRUE.rotors.motor_tau, prior.rate_tau)
    assert found is not None
    assert found.numbers.tau == pytest.approx(TRUE.rate_tau, rel=0.02)


def test_a_number_on_which_nothing_depends_is_as_uncertain_as_its_prior():
    rng = np.random.default_rng(0)
    values = rng.normal(size=200)
    jacobian = np.stack([np.ones(200), np.zeros(200)], axis=1)
    found = covariances(Linearized(jacobian, values, np.arange(200) // 10, np.array([1.0, 4.0])))
    assert np.isfinite(found.reported).all()
    assert found.reported[1, 1] == pytest.approx(0.25)
