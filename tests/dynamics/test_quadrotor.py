"""The model that MPPI plans with: closed-form flights, its equations against a fine integration,
its limits."""

from dataclasses import replace
from math import exp, pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from quadsim.dynamics.allocation import allocate, mixer, shares
from quadsim.dynamics.quadrotor import (
    ATTITUDE,
    BODY_RATES,
    POSE,
    POSITION,
    RIGID_BODY,
    STATE,
    VELOCITY,
    Control,
    ModelParams,
    State,
    quadrotor,
)
from quadsim.vehicle import GRAVITY, Rotors, Vehicle, load_vehicle

SIMPLE = ModelParams(
    rate_tau=(0.25, 0.2, 0.3), motor_tau=0.0, drag=0.0, rate_max=(6.0, 6.0, 6.0), thrust_max=36.0
)
FULL = replace(
    SIMPLE, motor_tau=0.04, drag=0.4, tilt_cost=(0.02, 0.03), yaw_cost=1.5
)  # with rotors that lag, saturate and drag
HOVER = Control(0.0, 0.0, 0.0, GRAVITY)
SAME = {"rtol": 0, "atol": 1e-9}


def state(**values):
    """At rest, level and hovering but for the values given by name."""
    return State(**{**dict.fromkeys(State._fields, 0.0), "qw": 1.0, "thrust": GRAVITY, **values})


def fly(model, u, seconds, x=None, dt=0.01):
    """Hold one control; every state by name.  -> name: (steps + 1,)"""
    system, path = quadrotor(model, dt), [x or state()]
    for _ in range(round(seconds / dt)):
        path.append(system.next(path[-1], u))
    return dict(zip(State._fields, np.array(path).T, strict=True))


def derivative(x, u, model):
    """The docstring's equations in matrices.  (17,) -> (17,)"""
    v, q, omega, a, beta = x[3:6], x[6:10], x[10:13], x[13], x[14:17]
    torque = (np.array(u[:3]) - omega) / model.rate_tau
    room = np.dot(model.tilt_cost, abs(torque[:2]))
    thrust = np.clip(u[3], room, model.thrust_max - room)
    if model.yaw_cost:
        most = (min(thrust, model.thrust_max - thrust) - room) / model.yaw_cost
        torque[2] = np.clip(torque[2], -most, most)
    if model.motor_tau:
        a_dot, beta_dot = (thrust - a) / model.motor_tau, (torque - beta) / model.motor_tau
    else:
        a, beta, a_dot, beta_dot = thrust, torque, 0.0, np.zeros(3)
    force = Rotation.from_quat(q, scalar_first=True).apply([0.0, 0.0, a])
    spin = 0.5 * np.array([-q[1:] @ omega, *(q[0] * omega + np.cross(q[1:], omega))])
    return np.concatenate(
        [v, force - (0, 0, GRAVITY) - model.drag * v, spin, beta, [a_dot], beta_dot]
    )


def error(model, dt, seconds=0.6):
    """Of the model's first ten states (p, v, q) after a brisk turn, against a fine integration."""
    x, u = state(vx=8.0, vy=-2.0, wx=1.0, thrust=12.0), (3.0, -2.0, 1.5, 15.0)
    fine = solve_ivp(
        lambda _, y: derivative(y, u, model), (0.0, seconds), x, rtol=1e-10, atol=1e-10
    ).y[:10, -1]
    return np.linalg.norm(
        [fly(model, u, seconds, x, dt)[name][-1] for name in State._fields[:10]] - fine
    )


@pytest.mark.parametrize("model", [SIMPLE, FULL])
def test_hover_holds_every_state(model):
    flown = fly(model, HOVER, 10.0)
    assert {name: np.ptp(path) for name, path in flown.items()} == dict.fromkeys(State._fields, 0.0)


def test_free_fall_is_half_g_t_squared():
    flown = fly(SIMPLE, (0.0, 0.0, 0.0, 0.0), 2.0)
    t = 0.01 * np.arange(201)
    np.testing.assert_allclose(flown["pz"], -0.5 * GRAVITY * t**2, **SAME)


def test_rate_step_is_63_percent_done_at_tau():
    flown = fly(SIMPLE, (1.0, 1.0, 1.0, GRAVITY), 0.3)
    for axis, tau in zip(("wx", "wy", "wz"), SIMPLE.rate_tau, strict=True):
        assert flown[axis][round(tau / 0.01)] == pytest.approx(1 - exp(-1))


def test_thrust_step_is_63_percent_done_at_the_motors_lag():
    flown = fly(FULL, (0.0, 0.0, 0.0, 2 * GRAVITY), 0.04)
    assert flown["thrust"][-1] / GRAVITY - 1 == pytest.approx(1 - exp(-1))


def test_fall_with_drag_ends_at_g_over_d():
    assert fly(FULL, (0.0, 0.0, 0.0, 0.0), 20 / FULL.drag)["vz"][-1] == pytest.approx(
        -GRAVITY / FULL.drag
    )


@pytest.mark.parametrize(
    ("rates", "ahead", "left"),
    [((0.0, 1.0, 0.0), 1, 0), ((-1.0, 0.0, 0.0), 0, 1), ((0.0, 0.0, 1.0), 0, 0)],
)
def test_pitching_down_goes_ahead_and_rolling_left_goes_left(rates, ahead, left):
    flown = fly(SIMPLE, (*rates, GRAVITY), 0.5)
    assert np.sign(np.round([flown["vx"][-1], flown["vy"][-1]], 9)).tolist() == [ahead, left]


def test_one_turn_at_a_constant_rate_comes_back():
    """One turn a second about the axis between body x and z; half of it after half a second."""
    rate = 2 * pi / np.sqrt(2)
    flown = fly(SIMPLE, (rate, 0.0, rate, GRAVITY), 1.0, state(wx=rate, wz=rate))
    assert abs(flown["qw"][-1]) == pytest.approx(1.0, abs=1e-5)
    assert flown["qw"][50] == pytest.approx(0.0, abs=1e-2)


def test_quaternion_stays_of_unit_length_in_a_tumble():
    rates = (6.0, -6.0, 6.0)
    flown = fly(SIMPLE, (*rates, 20.0), 10.0, state(wx=6.0, wy=-6.0, wz=6.0))
    length = sum(flown[name] ** 2 for name in ("qw", "qx", "qy", "qz"))
    assert abs(length - 1).max() < 1e-4


def test_without_motor_lag_it_is_the_13_state_model_of_the_paper():
    """Earlier thrust and torque of the rotors are forgotten; rates and thrust follow at once."""
    u = (3.0, -2.0, 1.0, 15.0)
    plain, disturbed = (
        fly(SIMPLE, u, 0.3, state(vx=5.0, **rotors))
        for rotors in ({}, {"thrust": 30.0, "bx": 50.0})
    )
    for name in State._fields[:13]:
        np.testing.assert_array_equal(plain[name], disturbed[name])
    assert set(plain["thrust"][1:]) == {15.0}


@pytest.mark.slow
@pytest.mark.parametrize(("model", "order"), [(SIMPLE, 2), (FULL, 1)])
def test_error_falls_with_the_step(model, order):
    """Of second order where the forces depend on attitude alone, else of first: lag and drag are
    taken at one end."""
    errors = [error(model, dt) for dt in (0.02, 0.01, 0.005)]
    observed = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(observed, order, atol=0.2)
    # m, m/s and parts of q together, after 0.6 s
    assert errors[1] < (0.001 if order == 2 else 0.05)


def test_numpy_rows_fly_as_floats_do():
    system = quadrotor(FULL, 0.01)
    x, u = (
        np.random.default_rng(0).normal(size=(17, 50)),
        np.random.default_rng(1).normal(size=(4, 50)),
    )
    rows = np.array(system.next(x, u))
    floats = [system.next(a.tolist(), b.tolist()) for a, b in zip(x.T, u.T, strict=True)]
    np.testing.assert_allclose(rows, np.array(floats).T, rtol=1e-14, atol=1e-14)


def test_columns_of_a_table_of_states_are_what_a_state_calls_by_the_same_names():
    table = np.random.default_rng(0).normal(size=(5, len(STATE)))
    for row in table:
        x = State(*row)
        np.testing.assert_array_equal(x.position, row[POSITION])
        np.testing.assert_array_equal(x.velocity, row[VELOCITY])
        np.testing.assert_array_equal(x.attitude, row[ATTITUDE])
        np.testing.assert_array_equal(x.body_rates, row[BODY_RATES])
        np.testing.assert_array_equal(row[POSE], [*x.position, *x.velocity, *x.attitude])
        np.testing.assert_array_equal(row[RIGID_BODY], [*row[POSE], *x.body_rates])
        assert (
            State.of(
                x.position, x.velocity, x.attitude, x.body_rates, x.thrust, x.angular_acceleration
            )
            == x
        )


def test_nominal_model_of_a_vehicle_has_all_but_the_axes_of_its_drag():
    rotors = Rotors(
        rotor_x=0.1,
        rotor_y=0.1,
        motor_omega_min=0.0,
        motor_omega_max=3e3,
        motor_tau=0.033,
        thrust_map=(1e-6, 0.0, 0.0),
        kappa=0.01,
    )
    plain = Vehicle(
        name="v",
        mass=1.0,
        inertia=(1e-3,) * 3,
        radius=0.1,
        rate_tau=(0.1, 0.2, 0.3),
        omega_max=(6.0, 7.0, 3.0),
        thrust_max=30.0,
        drag=(0.3, 0.6, 0.9),
        latency=0.01,
    )
    model = ModelParams((0.1, 0.2, 0.3), 0.0, pytest.approx(0.6), (6.0, 7.0, 3.0), 30.0)
    assert ModelParams.of(plain) == model
    assert ModelParams.of(replace(plain, rotors=rotors)) == replace(
        model, motor_tau=0.033, tilt_cost=(0.01, 0.01), yaw_cost=0.1
    )


def test_thrust_beside_a_tilt_is_what_the_rotors_deliver():
    """The collective of the allocation itself, over demands that saturate and demands that do
    not."""
    vehicle = load_vehicle("swift")
    system, share = (
        quadrotor(replace(ModelParams.of(vehicle), motor_tau=0.0), 0.01),
        shares(vehicle.rotors),
    )
    high = vehicle.mass * vehicle.thrust_max / 4  # of a rotor [N]
    p = system.params
    modest = []
    for beta_x, beta_y, a in np.random.default_rng(0).uniform(
        (-80, -80, 0), (80, 80, 40), (200, 3)
    ):
        torque = (vehicle.inertia[0] * beta_x, vehicle.inertia[1] * beta_y, 0.0)
        delivered = sum(allocate(share, vehicle.mass * a, torque, 0.0, high)) / vehicle.mass
        x = system.next(state(), Control(beta_x / p.rate_gain_x, beta_y / p.rate_gain_y, 0.0, a))
        assert x.thrust == pytest.approx(delivered, abs=1e-9)
        modest.append(delivered == pytest.approx(a))
    assert 0.2 < np.mean(modest) < 0.98


@pytest.mark.parametrize("tilted", [0.0, 60.0])
def test_yaw_beside_thrust_and_tilt_is_what_the_rotors_deliver(tilted):
    """That of the allocation itself; beside a tilt the model may promise less, never more."""
    vehicle = load_vehicle("swift")
    system, share = (
        quadrotor(replace(ModelParams.of(vehicle), motor_tau=0.0), 0.01),
        shares(vehicle.rotors),
    )
    high = vehicle.mass * vehicle.thrust_max / 4  # of a rotor [N]
    p = system.params
    short, cut = [], []
    for beta_x, beta_z, a in np.random.default_rng(0).uniform(
        (-tilted, -80, 0), (tilted, 80, 40), (200, 3)
    ):
        torque = (vehicle.inertia[0] * beta_x, 0.0, vehicle.inertia[2] * beta_z)
        forces = allocate(share, vehicle.mass * a, torque, 0.0, high)
        delivered = np.dot(mixer(vehicle.rotors)[3], forces) / vehicle.inertia[2]
        promised = system.next(
            state(), Control(beta_x / p.rate_gain_x, 0.0, beta_z / p.rate_gain_z, a)
        ).bz
        assert abs(promised) <= abs(delivered) + 0.01
        short.append(abs(delivered) - abs(promised))
        cut.append(abs(promised) < abs(beta_z) - 0.01)
    if not tilted:
        assert max(short) < 0.01
        assert 0.2 < np.mean(cut) < 0.98
    assert np.mean(np.array(short) < 1.0) > 0.5


def test_limits_are_the_models_and_rest_hovers():
    system = quadrotor(FULL, 0.01)
    assert (system.low, system.high) == ((-6.0, -6.0, -6.0, 0.0), (6.0, 6.0, 6.0, 36.0))
    assert system.rest == HOVER
