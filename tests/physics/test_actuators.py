"""The actuators keep their laws; no physics engine is needed to see it."""

from dataclasses import replace
from math import exp

import numpy as np
import pytest
from plant_cases import FULL, ROTORS

from quadsim.physics.actuators import Actuators
from quadsim.physics.link import HOVER
from quadsim.vehicle import GRAVITY, Vehicle

REST = (0.0, 0.0, 0.0)
POINT = Vehicle(
    name="point",
    source="test",
    mass=1.3,
    inertia=(0.0025, 0.0021, 0.0043),
    radius=0.1,
    rate_tau=(0.25, 0.1, 0.5),
    omega_max=(10.0, 10.0, 4.0),
    thrust_max=36.0,
    drag=REST,
    latency=0.0,
    rotors=None,
)
RACER = replace(
    POINT, mass=0.75, thrust_max=4 * FULL / 0.75, rate_tau=(0.06, 0.06, 0.2), rotors=ROTORS
)


@pytest.mark.parametrize("vehicle", [POINT, RACER])
def test_hover_command_carries_the_weight_and_turns_nothing(vehicle):
    actuators = Actuators(vehicle, 1 / 400)
    force, torque = actuators.wrench(HOVER, REST, REST)
    np.testing.assert_allclose(force, (0, 0, vehicle.mass * GRAVITY), rtol=1e-12)
    np.testing.assert_allclose(torque, REST, atol=1e-15)
    assert actuators.thrust == pytest.approx(GRAVITY, rel=1e-12)


@pytest.mark.parametrize("dt", [1 / 1000, 1 / 400, 1 / 100])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_rate_step_is_63_percent_done_at_tau_for_any_dt(axis, dt):
    actuators, inertia = Actuators(POINT, dt), np.array(POINT.inertia)
    command = [2.0 if i == axis else 0.0 for i in range(3)]
    omega = np.array(REST)
    for _ in range(round(POINT.rate_tau[axis] / dt)):
        _, torque = actuators.wrench((*command, GRAVITY), tuple(omega), REST)
        omega = omega + dt * (np.array(torque) - np.cross(omega, inertia * omega)) / inertia
    np.testing.assert_allclose(omega, np.array(command) * (1 - exp(-1)), atol=1e-12)


def test_commands_are_flown_within_their_limits():
    actuators, limit = Actuators(POINT, 1 / 400), (*POINT.omega_max, POINT.thrust_max)
    wild = actuators.wrench((99.0, 99.0, 99.0, 99.0), REST, REST)
    assert wild == Actuators(POINT, 1 / 400).wrench(limit, REST, REST)
    actuators.wrench((0.0, 0.0, 0.0, -5.0), REST, REST)
    assert actuators.thrust == 0.0


def test_a_command_that_is_no_number_is_refused():
    with pytest.raises(
        ValueError, match=r"command: expected finite body rates \[rad/s\] .* got \(0.0, nan"
    ):
        Actuators(POINT, 1 / 400).wrench((0.0, float("nan"), 0.0, GRAVITY), REST, REST)


def test_a_single_precision_command_does_not_lower_the_precision_of_the_flight():
    command = np.array((0.3, -0.7, 0.1, 11.3), dtype=np.float32)
    single, double = (
        Actuators(POINT, 1 / 400).wrench(u, REST, REST) for u in (command, command.tolist())
    )
    assert single == double
    assert {type(v) for part in single for v in part} == {float}


def test_latency_delays_a_command_by_exactly_its_steps_of_hover():
    actuators = Actuators(replace(POINT, latency=0.02), 1 / 400)
    thrusts = []
    for k in range(20):
        actuators.wrench((0.0, 0.0, 0.0, 20.0 + k), REST, REST)
        thrusts.append(actuators.thrust)
    np.testing.assert_allclose(thrusts, [GRAVITY] * 8 + [20.0 + k for k in range(12)])


def test_drag_opposes_each_body_axis_by_its_own_coefficient():
    drag, v = (0.3, 0.4, 0.5), (7.0, -2.0, 1.0)
    with_drag, without = (
        Actuators(replace(POINT, drag=d), 1 / 400).wrench(HOVER, REST, v)[0] for d in (drag, REST)
    )
    np.testing.assert_allclose(
        np.subtract(with_drag, without), [-1.3 * d * u for d, u in zip(drag, v, strict=True)]
    )


def test_rotors_never_pull_downwards():
    idling = replace(
        ROTORS,
        thrust_map=(1.33e-6, 0.003836, -1.769),
        motor_omega_min=150.0,
        motor_omega_max=2000.0,
    )
    motors = Actuators(replace(RACER, rotors=idling), 1 / 400).motors
    for _ in range(400):
        motors.drive(0.0, (9.0, 0.0, 0.0))
    thrusts = [idling.thrust(speed) for speed in motors.speeds]
    assert min(thrusts) == pytest.approx(0.0, abs=1e-9)
    assert max(thrusts) > 5.0


def test_rotor_speed_is_63_percent_of_the_way_at_tau():
    motors, dt = Actuators(RACER, 1 / 400).motors, 1 / 400
    before = np.array(motors.speeds)
    for _ in range(round(ROTORS.motor_tau / dt)):
        motors.drive(4 * 6.0, REST)
    command = ROTORS.speed(6.0)
    np.testing.assert_allclose(
        (motors.speeds - before) / (command - before), 1 - exp(-1), rtol=1e-12
    )


def test_delivered_thrust_stays_within_zero_and_thrust_max():
    actuators, rng = Actuators(RACER, 1 / 400), np.random.default_rng(3)
    thrusts = []
    for k in range(3000):
        if k % 50 == 0:
            rates = rng.choice([-12.0, 0.0, 12.0], size=3) * (k % 100 == 0)
            command = (*rates, rng.choice([-10.0, 12.0, 99.0]))
        actuators.wrench(command, REST, REST)
        thrusts.append(actuators.thrust)
    assert min(thrusts) >= 0.0
    assert 0.9 * RACER.thrust_max < max(thrusts) <= RACER.thrust_max + 1e-9
