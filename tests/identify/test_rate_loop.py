"""The rate loop of a fit: lags of its own, and a gain that follows the battery's voltage."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.dynamics.first_order import response
from quadsim.identify.prepared import prepare
from quadsim.identify.rate_loop import fit_rate_loop
from quadsim.identify.stretches import stretches
from quadsim.vehicle import load_vehicle
from tests.identify.fit_cases import DT, EVERY, flight

TAU = (0.05, 0.06, 0.15)
ROTOR_LAG = 0.033
LATE = 4  # rows of the log
NOISE = 0.01  # [rad/s]
PRIOR = load_vehicle("swift")


def loop_log(lag=ROTOR_LAG, battery=None, power=0.0):
    """Return a log whose body rates follow their setpoints by the model itself.

    Args:
        lag: of the angular accelerations [s].
        battery: voltage [V]  (n,).
        power: of the voltage over its median, by which the gain grows.
    """
    log = flight()
    dt = DT * EVERY
    steps = 2
    step = dt / steps
    gain = response(1.0, step) / step * np.ones((len(log.t), 3))
    for k in range(3):
        gain[:, k] = response(TAU[k], step) / step
    if battery is not None:
        gain *= ((battery / np.median(battery)) ** power)[:, None]
    omega = np.zeros(3)
    beta = np.zeros(3)
    rates = []
    for row in range(len(log.t)):
        rates.append(omega)
        setpoint = log.rate_setpoints[max(row - LATE, 0)]
        for _ in range(steps):
            beta = beta + response(lag, step) * (gain[row] * (setpoint - omega) - beta)
            omega = omega + step * beta
    noise = NOISE * np.random.default_rng(0).standard_normal((len(rates), 3))
    return replace(log, body_rates=np.array(rates) + noise, battery=battery)


def loop_of(log):
    found = fit_rate_loop(prepare(stretches(log), PRIOR), ROTOR_LAG, PRIOR.rate_tau)
    assert found is not None
    return found


@pytest.mark.slow
def test_the_model_itself_is_found_again_with_the_lag_of_the_rotors():
    found = loop_of(loop_log())
    assert found.numbers.tau == pytest.approx(TAU, rel=0.01)
    assert found.numbers.delay == pytest.approx(LATE * DT * EVERY, abs=5e-4)
    assert "lag_x" not in found.searched


@pytest.mark.slow
def test_accelerations_that_lag_behind_filters_have_a_lag_of_their_own():
    found = loop_of(loop_log(lag=0.07))
    assert found.numbers.lag == pytest.approx((0.07, 0.07, 0.07), rel=0.05)
    assert found.numbers.tau == pytest.approx(TAU, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("power", [0.0, 2.0])
def test_lags_are_those_at_the_median_voltage(power):
    """With a gain that is taken as constant, lags would be off by 5 % here and there."""
    battery = np.linspace(17.5, 14.5, len(flight().t))
    found = loop_of(loop_log(battery=battery, power=power))
    assert found.numbers.voltage_power == pytest.approx(power, abs=0.1)
    assert found.numbers.tau == pytest.approx(TAU, rel=0.01)
