"""The rate loop that is identified on the test bench: it is found again, and it predicts."""

from contextlib import closing
from dataclasses import replace
from functools import partial
from math import exp, pi, sqrt

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.firmware import identified as identified_module
from quadsim.firmware.identification import RateLoop, TestBench, identify
from quadsim.firmware.tuned_gains import FirmwareBench
from quadsim.physics.plant_state import start_state
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
        """Begin hovering.

        steps: number of physics steps in a control period.
        """
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
        """Step the model at the beginning of a period, and lead to its rates within the period."""
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
    nominal = ModelParams.of(vehicle)
    found = identify(nominal, PERIOD / 5, PERIOD, lambda: ModelActuators(vehicle, 5))
    model = found.model(nominal)
    for name, known in KNOWN.items():
        np.testing.assert_allclose(getattr(model, name), known, rtol=0.03, atol=2e-4)
    assert min(axis.explained for axis in found.axes) > 0.999


def test_a_rate_loop_overshoots_as_its_damping_ratio_says():
    """The overshoot of a second-order system is exp(-pi zeta / sqrt(1 - zeta^2))."""
    loop = RateLoop(rate_tau=0.03, rate_lag=0.04, explained=1.0)
    changes = {"rate_tau": (loop.rate_tau,) * 3, "rate_lag": (loop.rate_lag,) * 3}
    model = replace(ModelParams.of(load_vehicle("swift")), **changes)
    system = quadrotor(model, 1e-4)
    x = start_state(quadsim.load_course("figure8").start, 0.2)
    rates = []
    for _ in range(4000):
        x = State._make(system.next(x, Control(1.0, 0.0, 0.0, 20.0)))
        rates.append(x.wx)
    zeta = loop.damping
    assert max(rates) - 1.0 == pytest.approx(exp(-pi * zeta / sqrt(1.0 - zeta**2)), rel=0.02)
    # It is largest half a period of the damped oscillation after the step.
    peak = 1e-4 * np.argmax(rates)
    damped = loop.natural_frequency * sqrt(1.0 - zeta**2)
    assert peak == pytest.approx(pi / damped, rel=0.02)


def test_the_model_predicts_the_firmware_better_than_the_nominal_one(built):
    spec = quadsim.Spec.of("split_s_swift", flight_controller="betaflight")
    period = spec.planner.mppi.dt
    random = np.random.default_rng(5)
    levels = np.repeat(random.uniform(-3.0, 3.0, 30), random.integers(1, 25, 30))
    commands = [Control(level, 0.0, 0.0, 22.0) for level in levels.tolist()]

    # What the firmware does on the test bench
    with closing(FirmwareBench(spec.vehicle, spec.betaflight, 1e-3, period).actuators()) as flown:
        bench = TestBench(flown, 1e-3)
        measured = []
        for command in commands:
            measured.append(bench.rates[0])
            for _ in range(10):
                bench.step(command)

    def error(model):
        system = quadrotor(model, period)
        x = start_state(spec.course.start, spec.vehicle.radius)
        rates = []
        for command in commands:
            rates.append(x.wx)
            x = State._make(system.next(x, command))
        return np.std(np.subtract(rates, measured))

    assert spec.model != ModelParams.of(spec.vehicle)
    assert error(spec.model) < 0.7 * error(ModelParams.of(spec.vehicle))


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


@pytest.fixture
def identifications(built, monkeypatch, tmp_path):
    """Return the identifications that are made, each of them without a flight, and their cache."""
    spec = quadsim.Spec.of("split_s_swift", flight_controller="betaflight")
    found = identified_module.identified(spec.vehicle, spec.betaflight, 1e-3, PERIOD)
    made = []

    def identify(nominal, dt, period, actuators):
        made.append((nominal, dt, period))
        return found

    monkeypatch.setattr(identified_module, "identify", identify)
    monkeypatch.setattr(identified_module, "cache_folder", lambda: tmp_path)
    ask = partial(
        identified_module.identified.__wrapped__, spec.vehicle, spec.betaflight, 1e-3, PERIOD
    )
    return made, found, ask


def test_a_first_identification_says_what_takes_the_time(identifications, caplog):
    """The second one comes from the cache."""
    made, found, ask = identifications
    assert ask() == found
    assert len(caplog.messages) == 1
    assert "identifying the rate loop of swift behind Betaflight" in caplog.messages[0]
    assert ask() == found
    assert made == [(ModelParams.of(load_vehicle("swift")), 1e-3, PERIOD)]
    assert len(caplog.messages) == 1


def test_a_cache_that_cannot_be_written_does_not_stop_a_flight(identifications, tmp_path):
    made, found, ask = identifications
    (tmp_path / "identified").write_text("no folder")
    assert [ask(), ask()] == [found, found]
    assert len(made) == 2
