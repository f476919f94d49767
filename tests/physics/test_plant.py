"""Plants obey physics with actuators on, are deterministic, and may be the planner's model."""

import subprocess
import sys
from dataclasses import replace
from math import exp, pi

import numpy as np
import pytest
from plant_cases import DT, HOVER, SKY, ModelPlant, both_plants

from quadsim.course import Start, course_names, load_course
from quadsim.dynamics.quadrotor import STATE, ModelParams, quadrotor
from quadsim.physics.plant_state import CLEARANCE
from quadsim.vehicle import GRAVITY, load_vehicle, vehicle_names

FALL = (0.0, 0.0, 0.0, 0.0)
PAPER = replace(load_vehicle("paper"), inertia=(0.0025, 0.0021, 0.0043), rate_tau=(0.25, 0.2, 0.3))
SWIFT = load_vehicle("swift")


def column(state, *names):
    return np.array([state.x[STATE.index(name)] for name in names])


def fly(plant, seconds, u):
    """Hold one command; the last state."""
    for _ in range(round(seconds / plant.dt)):
        plant.step(u)
    return plant.state


def weave(t):
    """A lively, smooth command within the limits."""
    return 2.0 * np.sin(7 * t), 1.5 * np.cos(5 * t), np.sin(3 * t), GRAVITY + 4.0 * np.sin(9 * t)


@pytest.fixture(params=both_plants)
def launch(request):
    """launch(vehicle, ...): a plant in the sky, of each kind in turn."""
    plants = []

    def make(vehicle=PAPER, course=SKY, **options):
        plants.append(request.param(course, vehicle, **options))
        return plants[-1]

    yield make
    for plant in plants:
        plant.close()


def test_it_starts_at_rest_on_the_start_with_hover_thrust(launch):
    state = launch(start=Start((3.0, -1.0, 7.0), pi / 2)).state
    half = 0.5**0.5
    np.testing.assert_allclose(
        state.x, (3, -1, 7, 0, 0, 0, half, 0, 0, half, 0, 0, 0, GRAVITY, 0, 0, 0), atol=1e-12
    )
    assert (state.t, state.contacts) == (0.0, ())


def test_a_start_on_the_ground_stands_just_clear_of_it(launch):
    plant = launch(start=Start((0.0, 0.0, 0.01), 0.0))
    assert column(plant.state, "pz") == pytest.approx(PAPER.radius + CLEARANCE)
    assert fly(plant, 0.2, HOVER).contacts == ()
    assert fly(plant, 0.2, FALL).contacts == ("ground",)


@pytest.mark.parametrize("course", course_names())
def test_every_course_starts_clear_of_ground_and_gates(launch, course):
    assert fly(launch(course=load_course(course)), 0.1, HOVER).contacts == ()


@pytest.mark.slow
@pytest.mark.parametrize("name", vehicle_names())
def test_every_vehicle_hovers_still(launch, name):
    plant = launch(load_vehicle(name))
    before, after = plant.state, fly(plant, 3.0, HOVER)
    np.testing.assert_allclose(after.x, before.x, atol=1e-9)
    assert after.t == pytest.approx(3.0)


def test_without_thrust_it_falls_half_g_t_squared(launch):
    plant = launch()
    state = fly(plant, 1.0, FALL)
    assert column(state, "vz") == pytest.approx(-GRAVITY)
    assert column(state, "pz") - 200.0 == pytest.approx(-GRAVITY / 2, abs=1.01 * GRAVITY * DT / 2)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_rate_step_is_63_percent_done_at_tau(launch, axis):
    """All three axes turn at once: the feed-forward must cancel what the unequal inertias
    couple."""
    command = (3.0, 4.0, -2.0)
    state = fly(launch(), PAPER.rate_tau[axis], (*command, GRAVITY))
    assert state.x.body_rates[axis] / command[axis] == pytest.approx(1 - exp(-1), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", vehicle_names())
def test_every_vehicle_settles_on_its_commanded_rates_with_little_overshoot(launch, name):
    """With motors, tau s (lag s + 1) + 1 has damping sqrt(tau / lag) / 2: above .5 for all but the
    Crazyflie of the class, which has .42."""
    vehicle = load_vehicle(name)
    model = ModelParams.of(vehicle)
    lags = np.maximum(model.rate_lags, 1e-6)
    damping = np.minimum(np.sqrt(model.rate_tau / lags) / 2, 0.99)
    overshoot = np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2))
    assert (overshoot < (0.24 if name == "cf21b_500" else 0.165)).all()
    plant = launch(vehicle)
    command = (3.0, -3.0, 0.2)
    rates = np.array([plant.step((*command, GRAVITY)).x.body_rates for _ in range(800)])
    np.testing.assert_allclose(rates[-1], command, rtol=0.02)
    most = 1.0 + np.maximum(overshoot, 0.15)
    assert (np.abs(rates).max(axis=0) < 1.01 * most * np.abs(command)).all()


def test_a_fall_with_drag_ends_at_g_over_d(launch):
    plant = launch(replace(PAPER, drag=(0.0, 0.0, 4.0)), start=Start((0.0, 0.0, 900.0), 0.0))
    # 20 time constants of a quarter of a second
    assert column(fly(plant, 5.0, FALL), "vz") == pytest.approx(-GRAVITY / 4.0, rel=1e-6)


def test_pitching_forward_flies_where_the_nose_looks(launch):
    plant = launch(start=Start((0.0, 0.0, 200.0), pi / 2))
    vx, vy = column(fly(plant, 0.4, (0.0, 2.0, 0.0, GRAVITY)), "vx", "vy")
    assert vy > 0.3
    assert vx == pytest.approx(0.0, abs=1e-9)


def test_a_flight_is_the_same_for_every_heading(launch):
    """Drag along the nose only, so a plant that mixed up body and world would show it."""
    vehicle = replace(PAPER, drag=(2.0, 0.0, 0.0))
    north, east = (launch(vehicle, start=Start((0.0, 0.0, 200.0), yaw)) for yaw in (pi / 2, 0.0))
    for k in range(400):
        north.step(weave(k * DT))
        east.step(weave(k * DT))
    (nx, ny, nz), (ex, ey, ez) = (column(plant.state, "vx", "vy", "vz") for plant in (north, east))
    assert (ny, -nx, nz) == pytest.approx((ex, ey, ez), abs=1e-9)


def test_thrust_of_rotors_lags_and_thrust_without_rotors_does_not(launch):
    u = (0.0, 0.0, 0.0, 20.0)
    assert column(launch().step(u), "a") == 20.0
    assert GRAVITY < column(launch(SWIFT).step(u), "a") < 11.0


@pytest.mark.slow
@pytest.mark.parametrize("vehicle", [PAPER, SWIFT])
def test_the_same_commands_give_the_same_states_to_the_last_bit(launch, vehicle):
    # interleaved: worlds must not disturb each other either
    one, two = launch(vehicle), launch(vehicle)
    for k in range(800):
        u = weave(k * DT)
        assert one.step(u) == two.step(u)


def gap(launch, model_dt, plant_dt):
    """Largest difference of each state between model and plant in a second of lively flight.
    (17,)"""
    plant = launch(dt=plant_dt)
    model = ModelPlant(quadrotor(ModelParams.of(PAPER), model_dt), plant.state.x)
    gaps = []
    for k in range(round(1.0 / model_dt)):
        u = weave(k * model_dt)
        gaps.append(np.subtract(fly(plant, model_dt, u).x, model.step(u).x))
    return np.abs(gaps).max(axis=0)


def test_model_and_plant_agree_in_free_flight_and_converge_with_the_step(launch):
    coarse, fine = gap(launch, 1 / 200, 1 / 200), gap(launch, 1 / 800, 1 / 800)
    assert coarse[10:].max() < 1e-6  # rates, thrust and angular acceleration are the same formula
    # the plants move and turn with the new velocity, the model with the mean one: first order in
    # the step
    assert coarse[:3].max() < 0.01
    assert coarse[3:10].max() < 0.002
    assert fine[:10].max() == pytest.approx(coarse[:10].max() / 4, rel=0.1)


def test_a_model_at_100_hz_predicts_a_plant_at_400_hz_to_5_mm_in_a_second(launch):
    worst = gap(launch, 1 / 100, 1 / 400)
    assert worst[:3].max() < 0.005
    assert worst[6:10].max() < 0.005


@pytest.mark.process
def test_models_and_referees_do_not_load_the_physics_engine():
    code = "import sys, quadsim.physics.plant; print('pybullet' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    assert done.stdout == b"False\n"
