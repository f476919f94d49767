"""The rate loop that is identified on the test bench: it is found again, and it predicts."""

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.physics.identification import identify
from quadsim.physics.plant_state import start_state
from quadsim.spec.identified import identified
from quadsim.vehicle import load_vehicle

PERIOD = 0.01
# A rate loop with other numbers than the vehicle's own
KNOWN = {
    "rate_tau": (0.03, 0.04, 0.06),
    "rate_lag": (0.025, 0.03, 0.045),
    "motor_tau": 0.035,
    "delay": 0.0,
}


class ModelActuators:
    """Actuators that do what the planner's model does, once in a control period."""

    def __init__(self, vehicle, steps):
        """Begin hovering; a control period has so many physics steps."""
        model = quadsim.Spec.of("figure8", **{f"model_{k}": v for k, v in KNOWN.items()}).model
        self._system = quadrotor(model, PERIOD)
        self._x = start_state(quadsim.load_course("figure8").start, vehicle.radius)
        self._dt = PERIOD / steps
        self._steps = steps
        self._step = 0
        self._rates = (0.0, 0.0, 0.0)
        self.thrust = self._x.thrust
        self.angular_acceleration = (0.0, 0.0, 0.0)

    def wrench(self, command, omega_body, v_body, attitude):
        """Move the model at the begin of a period, and lead to its rates within it."""
        if self._step % self._steps == 0:
            x = self._x._replace(wx=omega_body[0], wy=omega_body[1], wz=omega_body[2])
            self._x = State._make(map(float, self._system.next(x, Control(*command))))
            change = np.subtract(self._x.body_rates, omega_body) / PERIOD
            self.angular_acceleration = tuple(change.tolist())
            self.thrust = self._x.thrust
        self._step += 1

    def close(self):
        """Do nothing."""


def test_the_numbers_of_a_known_rate_loop_are_found_again():
    vehicle = load_vehicle("swift")
    found = identify(vehicle, PERIOD / 5, PERIOD, lambda: ModelActuators(vehicle, 5))
    model = found.model(vehicle)
    for name, known in KNOWN.items():
        np.testing.assert_allclose(getattr(model, name), known, rtol=0.03, atol=2e-4)
    assert min(axis.explained for axis in found.axes) > 0.999


def test_the_second_order_system_has_its_frequency_and_damping():
    """They are those of omega'' = w_n^2 (omega_cmd - omega) - 2 zeta w_n omega'."""
    found = identified_swift_like()
    roll = found.roll
    wn, zeta = roll.natural_frequency, roll.damping
    assert wn**2 == pytest.approx(1.0 / (roll.rate_tau * roll.rate_lag))
    assert 2.0 * zeta * wn == pytest.approx(1.0 / roll.rate_lag)


def identified_swift_like():
    vehicle = load_vehicle("swift")
    return identify(vehicle, PERIOD / 5, PERIOD, lambda: ModelActuators(vehicle, 5))


def test_the_model_predicts_the_firmware_better_than_the_nominal_one(built):
    spec = quadsim.Spec.of("split_s_swift", flight_controller="betaflight")
    found = identified(spec.vehicle, spec.betaflight, spec.plant_dt, spec.planner.mppi.dt)
    assert min(axis.explained for axis in found.axes) > 0.95
    assert spec.model == found.model(spec.vehicle)
    assert spec.model != ModelParams.of(spec.vehicle)
    assert spec.model.yaw_first


def test_a_given_number_of_the_model_takes_the_place_of_the_identified_one(built):
    spec = quadsim.Spec.of("split_s_swift", flight_controller="betaflight", model_delay=0.008)
    assert spec.model.delay == 0.008


def test_the_command_shows_what_was_identified(built, capsys):
    assert race(["firmware", "identify"]) == 0
    shown = capsys.readouterr().out
    for name in ("swift behind Betaflight", "roll", "pitch", "yaw", "thrust", "delay"):
        assert name in shown


def test_what_only_an_identification_has_is_refused_elsewhere(capsys):
    assert race(["firmware", "build", "--vehicle", "swift"]) == 2
    said = capsys.readouterr().err.strip()
    assert said == "race firmware: --vehicle: expected none beside build, got 'swift'"
