"""The numbers of the vehicle, learnt in flight: errors as large as their deviations, small after
two seconds."""

from contextlib import closing
from dataclasses import replace
from importlib.util import find_spec
from itertools import pairwise

import numpy as np
import pytest

from quadsim.config.build import build, planner_of
from quadsim.config.spec import Spec
from quadsim.course import load_course
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control, ModelParams, State, quadrotor
from quadsim.physics.actuators import Actuators
from quadsim.physics.domain_randomization import Randomization, gusts
from quadsim.physics.faults import FactorFault, RotorFault, Window
from quadsim.physics.plant import PLANTS, RigidPlant, default_plant, start_state
from quadsim.physics.rotorpy_plant import RotorpyPlant
from quadsim.racing.flight import simulate
from quadsim.rotation import to_body, turned
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.estimation.body_rates import BodyRates
from quadsim.sensing.estimation.prediction import Acted
from quadsim.sensing.estimation.vehicle_learner import FORCE_STD, Row, VehicleLearner
from quadsim.sensing.nominal import Nominal
from quadsim.vehicle import GRAVITY, load_vehicle
from quadsim.vehicle.tolerances import VehicleTolerances
from tests.small import SMALL

DT = 0.01
SWIFT = load_vehicle("swift")
NOMINAL = ModelParams.of(SWIFT)
REAL = VehicleTolerances()
HOVER = Control(0.0, 0.0, 0.0, GRAVITY)

SEEDS = 12
# Chi-square with that many degrees of freedom, over them: 99.8 % lie between.
LEAST, MOST = 0.18, 2.74


def alone(u):
    """Return a command that acted for the whole period."""
    return Acted((u,), (1.0,))


def simulated(seed, gust=REAL.gust, steps=200):
    """States of a vehicle that tumbles at changing thrust, by the law that the filter assumes, and
    its true k and d."""
    rng = np.random.default_rng(seed)
    k, d = 1 + REAL.mass * rng.uniform(-1, 1), NOMINAL.drag * (1 + REAL.drag * rng.uniform(-1, 1))
    wind = gusts(np.random.SeedSequence(seed), gust, DT)
    x = np.array(start_state(load_course("figure8").start, 0.1))
    a0, phase = 20.0, rng.uniform(0, 6, 2)
    states = []
    for i in range(steps):
        states.append(x)
        t, x0, x = (i + 1) * DT, x, x.copy()
        x[13] = a0 + 10 * np.sin(3 * t + phase[0])
        roll = 1.2 * np.sin(2 * t + phase[1])
        x[6:10] = np.cos(roll / 2), np.sin(roll / 2), 0, 0
        f = (_lift(x0) + _lift(x)) / 2
        drift = k * f - np.array([0, 0, GRAVITY]) + next(wind)
        x[3:6] = ((1 - d * DT / 2) * x0[3:6] + DT * drift) / (1 + d * DT / 2)
    return np.array(states), k, d


def _lift(x):
    w, i = x[6:8]
    return x[13] * np.array([0.0, -2 * w * i, 1 - 2 * i * i])


def errors(gust):
    """Return errors of k and d after 2 s in the filter's standard deviations, and of k as a share.
    (SEEDS, 3)"""
    found = []
    for seed in range(SEEDS):
        states, k, d = simulated(seed, gust)
        learner = VehicleLearner.for_exact_states(NOMINAL, DT)
        for before, after in pairwise(states):
            learner.learn_from_states(State(*before), State(*after), alone(HOVER), DT)
        now, std = learner.numbers, learner.std
        off = np.array([now.thrust_gain - k, now.drag - d])
        found.append([*off / (std.thrust_gain, std.drag), off[0]])
    return np.array(found)


def test_errors_are_as_large_as_the_covariance():
    off = errors(REAL.gust)
    mean_square = np.mean(off[:, :2] ** 2, axis=0)
    assert np.all((mean_square > LEAST) & (mean_square < MOST)), mean_square
    assert np.abs(off[:, 2]).max() < 0.02 < REAL.mass


def test_a_wind_beyond_its_prior_makes_errors_beyond_its_deviations():
    assert np.mean(errors(4 * REAL.gust)[:, :2] ** 2) > 4


@pytest.mark.parametrize("share", [-0.05, 0.0])
def test_the_highest_thrust_is_what_the_rotors_gave_when_asked_for_more(share):
    full = Control(0.0, 0.0, 0.0, NOMINAL.thrust_max)
    assert _highest(share, full) == pytest.approx((1 + share) * NOMINAL.thrust_max, rel=0.01)


def test_rotors_that_follow_say_nothing_about_their_limit():
    assert _highest(-0.05, Control(0.0, 0.0, 0.0, 0.9 * NOMINAL.thrust_max)) == NOMINAL.thrust_max


def _highest(share, u):
    """Estimated after half a second straight up [m/s^2]."""
    learner = VehicleLearner.for_exact_states(NOMINAL, DT)
    course = replace(load_course("figure8"), bounds=((-99, 99), (-99, 99), (-1, 99)))
    with closing(
        PLANTS[default_plant()](course, Randomization(thrust=share).vehicle(SWIFT))
    ) as plant:
        for _ in range(50):
            before = State(*plant.state.x)
            for _ in range(4):
                plant.step(u)
            learner.learn_from_states(before, State(*plant.state.x), alone(u), DT)
    return learner.model.thrust_max


@pytest.mark.slow
def test_commands_that_change_within_a_period_hide_no_thrust():
    """On the wall clock a period begins under the command before, which white noise makes another
    one. Told the new command alone, the learner takes a thrust in between for the highest."""
    rng = np.random.default_rng(0)
    learner, mistaken = (VehicleLearner.for_exact_states(NOMINAL, DT) for _ in range(2))
    course = replace(load_course("figure8"), bounds=((-99, 99), (-99, 99), (-99, 99)))
    new = HOVER
    with closing(PLANTS[default_plant()](course, SWIFT)) as plant:
        for _ in range(300):
            old, new = new, Control(*rng.normal(0.0, 3.0, 3), rng.uniform(20.0, 60.0))
            before = State(*plant.state.x)
            for u in (old, old, new, new):
                plant.step(u)
            after = State(*plant.state.x)
            learner.learn_from_states(before, after, Acted((old, new), (0.5, 0.5)), DT)
            mistaken.learn_from_states(before, after, alone(new), DT)
    assert learner.model.thrust_max == pytest.approx(NOMINAL.thrust_max, rel=0.01)
    assert learner.model.tilt_first
    assert mistaken.model.thrust_max < 0.98 * NOMINAL.thrust_max
    assert not mistaken.model.tilt_first


def flown_at_the_limit(strengths, start=1.0, low=0.5, model=NOMINAL, vehicle=None):
    """Return the learner after a flight whose commands are limited by its own estimate.

    Every second the command is low for a fifth of a second.

    Args:
        strengths: shares of the rotors' thrusts, which the mixer does not know  (4,).
        start: the first estimate of the highest thrust, as a share of the nominal.
        low: the low command, as a share of the estimate.
        model: the nominal model.
        vehicle: the nominal vehicle, if its rotors are learned.
    """
    faults = [RotorFault(rotor, share, Window(0.0)) for rotor, share in enumerate(strengths, 1)]
    actuators = Actuators(SWIFT, DT, faults)
    learner = VehicleLearner.for_exact_states(model, DT, vehicle=vehicle)
    learner._theta[Row.THRUST_MAX] *= start
    rates, thrust, beta = np.zeros(3), GRAVITY, (0.0, 0.0, 0.0)
    for i in range(400):
        most = learner.numbers.thrust_max
        rate = 2.0 * (-1) ** (i // 10)
        u = Control(rate, -rate, 0.0, low * most if i % 100 < 20 else most)
        actuators.wrench(u, tuple(rates), (0.0, 0.0, 0.0))
        before = State.of((0, 0, 0), (0, 0, 0), (1, 0, 0, 0), tuple(rates), thrust, beta)
        thrust, beta = actuators.thrust, actuators.angular_acceleration
        rates = rates + np.array(beta) * DT
        after = State.of((0, 0, 0), (0, 0, 0), (1, 0, 0, 0), tuple(rates), thrust, beta)
        learner.learn_from_states(before, after, alone(u), DT)
    return learner


@pytest.mark.parametrize("strengths", [(0.9,) * 4, (0.9, 1.0, 1.0, 1.0), (1.0, 1.0, 1.0, 0.7)])
@pytest.mark.parametrize("low", [0.5, 1.0])
def test_a_thrust_that_is_short_at_every_level_is_no_limit(strengths, low):
    learner = flown_at_the_limit(strengths, low=low)
    assert learner.numbers.thrust_max > 0.94 * NOMINAL.thrust_max


@pytest.mark.parametrize("low", [0.5, 1.0])
def test_a_thrust_that_was_taken_for_a_limit_becomes_a_share_of_the_rotors(low):
    """Full thrust alone does not tell a lower limit from weak rotors. If the thrust is short again
    at the lower limit, it is the rotors, and the full command comes back."""
    learner = flown_at_the_limit((0.9,) * 4, low=low, vehicle=SWIFT)
    assert learner.numbers.thrust_max > 0.98 * NOMINAL.thrust_max
    assert learner.delivered.thrust_share == pytest.approx(0.9, abs=0.03)


@pytest.mark.parametrize("strengths", [(0.9,) * 4, (1.0, 1.0, 1.0, 0.7)])
def test_weak_rotors_do_not_halve_the_limit_of_a_mixer_that_gives_up_thrust(strengths):
    learner = flown_at_the_limit(strengths, model=replace(NOMINAL, yaw_first=True), low=1.0)
    assert learner.numbers.thrust_max >= 0.9 * NOMINAL.thrust_max


def test_an_estimate_of_the_highest_thrust_that_is_too_low_comes_back():
    learner = flown_at_the_limit((1.0,) * 4, start=0.6)
    assert learner.numbers.thrust_max > 0.94 * NOMINAL.thrust_max


def test_a_payload_that_is_picked_up_in_flight_is_found_in_some_seconds():
    """Its weight is a gust at first, until the thrust has had other directions."""
    payload = FactorFault("mass", 1.1, Window(2.0))
    plant = RigidPlant(load_course("split_s_swift"), SWIFT, faults=[payload])
    learner = VehicleLearner.for_exact_states(NOMINAL, DT)
    rng = np.random.default_rng(0)
    gains = []
    for k in range(600):
        if k % 15 == 0:
            u = Control(*rng.uniform(-3.0, 3.0, 3), thrust=rng.uniform(8.0, 36.0))
        before = State(*plant.state.x)
        for _ in range(4):
            plant.step(u)
        learner.learn_from_states(before, State(*plant.state.x), alone(u), DT)
        gains.append(learner.numbers.thrust_gain)
    assert gains[199] == pytest.approx(1.0, abs=0.01)
    missing = np.subtract(gains[200:], 1 / 1.1)
    assert missing[200] < 0.7 * missing[0]
    assert missing[-1] < 0.4 * missing[0]


@pytest.mark.parametrize("strengths", [(0.8, 1.0, 1.0, 1.0), (1.0, 1.0, 0.8, 1.0)])
def test_a_torque_that_was_not_asked_for_is_no_torque_that_is_not_delivered(strengths):
    assert flown_at_the_limit(strengths).model.tilt_first


def test_a_torque_that_is_missing_at_the_limit_is_not_delivered():
    """The commands keep their sign, so the missing half of the torque does, too."""
    learner = VehicleLearner.for_exact_states(NOMINAL, DT)
    u = Control(4.0, -4.0, 0.0, NOMINAL.thrust_max)
    half = tuple(0.5 * rate / tau for rate, tau in zip(u.body_rates, NOMINAL.rate_tau, strict=True))
    x = State.of((0, 0, 0), (0, 0, 0), (1, 0, 0, 0), (0, 0, 0), 0.9 * NOMINAL.thrust_max, half)
    for _ in range(200):
        learner.learn_from_states(x, x, alone(u), DT)
    assert not learner.model.tilt_first


def learnt_at_full_thrust(plant, vehicle, seconds, tilt=3.0):
    """Return the model after a flight at full thrust, rolling and pitching one way and the other.

    tilt: the body rates [rad/s].
    """
    learner, full = (
        VehicleLearner.for_exact_states(ModelParams.of(vehicle), DT),
        0.99 * vehicle.thrust_max,
    )
    with closing(plant(load_course("figure8"), vehicle)) as plant:
        for i in range(round(seconds / DT)):
            rate = tilt * (-1) ** (i // 15)
            u, before = Control(rate, -rate, 0.0, full), State(*plant.state.x)
            for _ in range(4):
                plant.step(u)
            if i > 0:
                learner.learn_from_states(before, State(*plant.state.x), alone(u), DT)
    return learner.model


@pytest.mark.slow
@pytest.mark.parametrize("name", ["swift", "crazyflie", "cpc"])
def test_whether_the_flight_controller_gives_up_thrust_to_tilt_is_learnt(name):
    vehicle = load_vehicle(name)
    assert learnt_at_full_thrust(PLANTS[default_plant()], vehicle, 1.5).tilt_first
    if find_spec("rotorpy"):
        assert not learnt_at_full_thrust(RotorpyPlant, vehicle, 0.75).tilt_first
        assert learnt_at_full_thrust(RotorpyPlant, vehicle, 0.75, tilt=0.0).tilt_first, (
            "nothing was seen of it"
        )


@pytest.mark.compiled
def test_a_flight_with_a_vehicle_too_heavy_learns_it():
    spec = Spec.of(
        "paper_flat",
        vehicle="swift",
        preset="race",
        **SMALL,
        target_ess=20,
        timeout=1.5,
        randomize=1.0,
        seed=8,
    )
    parts = build(spec)
    mppi = parts.controller.planner
    navigation = parts.navigation
    with closing(parts.plant):
        *_, last = simulate(parts)
    mass = spec.record()["variation"]["mass"]
    assert mass > 0.03
    assert last.t == pytest.approx(1.5)
    learnt = navigation.learner.model
    assert learnt.thrust_gain == pytest.approx(1 / (1 + mass), abs=0.015)
    assert mppi.model.params == quadrotor(learnt, DT).params, "the planner plans with it"
    successor = planner_of(spec, spec.streams[0])
    successor.continue_from(mppi)
    estimate = navigation.estimate(last.t)
    successor.control(estimate)
    assert successor.model.params == estimate.model.params, "and so does one that takes over"
    assert successor.model.params != planner_of(spec, spec.streams[0]).model.params


@pytest.mark.compiled
def test_a_planner_that_does_not_adapt_is_given_no_model():
    spec = Spec.of("paper_flat", vehicle="swift", preset="race", adapt=False, **SMALL)
    parts = build(spec)
    navigation = parts.navigation
    parts.plant.close()
    assert navigation.learner is None
    estimate = navigation.estimate(0.0)
    assert isinstance(estimate, Estimate)
    assert estimate.model is None
    assert estimate.course is None, "the map is all that is known without sensors"


def sensed(seed, gust=REAL.gust, noise=0.1, taken_for=0.1, rotors=None, steps=300):
    """Errors of thrust, thrust gain and drag in standard deviations, after a flight on noisy
    forces.

    The vehicle is `simulated` by the law that the filter assumes: its thrust lags behind its
    command.
    noise: of the specific force [m/s^2], which the filter takes for `taken_for`. rotors: standard
    deviation of the thrust by rotor speeds [m/s^2].
    """
    rng = np.random.default_rng(seed)
    k = 1 + REAL.mass * rng.uniform(-1, 1)
    d = NOMINAL.drag * (1 + REAL.drag * rng.uniform(-1, 1))
    wind = gusts(np.random.SeedSequence(seed), gust, DT)
    learner = VehicleLearner.for_sensors(
        NOMINAL, DT, ImuConfig(250.0, accelerometer_noise=taken_for)
    )
    lag = quadrotor(NOMINAL, DT).params[3]
    a, q, v = GRAVITY, (1.0, 0.0, 0.0, 0.0), np.zeros(3)
    phase = rng.uniform(0, 6, 2)
    for i in range(steps):
        t = i * DT
        a_cmd = 20.0 + 10.0 * np.sin(3 * t + phase[0])
        a += (a_cmd - a) * lag + 0.05 * rng.standard_normal()
        q = turned(q, (2.4 * np.cos(2 * t + phase[1]) * DT, 0.0, 0.0))
        w = np.array(next(wind))
        body_from_world = np.column_stack([to_body(q, axis) for axis in np.eye(3)])  # R(q)^T
        force = np.array([0.0, 0.0, k * a]) + body_from_world @ (w - d * v)
        v = v + DT * (body_from_world.T @ force - (0.0, 0.0, GRAVITY))
        measured = force + np.hypot(noise, FORCE_STD) * rng.standard_normal(3)
        learner.learn_from_force(a_cmd, 0.0, tuple(measured), Nominal(t, (0.0,) * 3, tuple(v), q))
        if rotors:
            learner.learn_from_rotors(a + rotors * rng.standard_normal(), rotors)
    now, std = learner.numbers, learner.std
    return (
        (now.thrust - a) / std.thrust,
        (now.thrust_gain - k) / std.thrust_gain,
        (now.drag - d) / std.drag,
    )


@pytest.mark.slow
@pytest.mark.parametrize("rotors", [None, 0.1])
def test_errors_from_sensors_are_no_larger_than_the_filter_expects(rotors):
    """The rotors' own lag is taken as uncertain though it is known here: then only the upper bound
    holds."""
    off = np.array([sensed(seed, rotors=rotors) for seed in range(SEEDS)])
    mean_square = np.mean(off**2, axis=0)
    assert np.all(mean_square < MOST), mean_square
    assert np.all(mean_square > 0.1), mean_square


@pytest.mark.slow
def test_an_accelerometer_worse_than_it_is_taken_for_makes_errors_beyond_the_filters_deviations():
    off = np.array([sensed(seed, noise=2.0, rotors=0.1) for seed in range(SEEDS)])
    assert np.mean(off**2) > MOST


def test_rotor_speeds_make_the_thrust_better_known():
    """A force alone tells weak rotors from a heavy vehicle by the model of the rotors only."""
    std = {}
    for rotors in (None, 0.1):
        learner = VehicleLearner.for_sensors(NOMINAL, DT, ImuConfig(250.0, accelerometer_noise=0.1))
        for k in range(200):
            learner.learn_from_force(
                20.0, 0.0, (0.0, 0.0, 20.0), Nominal(k * DT, *((0.0,) * 3,) * 2, (1.0, 0, 0, 0))
            )
            if rotors:
                learner.learn_from_rotors(20.0, rotors)
        std[rotors] = learner.std.thrust
    assert std[0.1] < 0.8 * std[None]


def test_body_rates_follow_the_gyroscope_and_the_model_without_one():
    """A plant that turns as the model says is followed by the model alone; one that does not, by
    the gyroscope."""
    rates = BodyRates(NOMINAL, DT, ImuConfig(250.0, gyro_noise=0.01))
    system, x = quadrotor(NOMINAL, DT), tuple(start_state(load_course("figure8").start, 0.1))
    for k in range(100):
        u = Control(2.0 * np.sin(0.1 * k), 1.0 * np.cos(0.07 * k), 0.3, 20.0)
        x = system.next(x, u)
        rates.advance(u, None)
    now = State(*x)
    assert rates.rates == pytest.approx(now.body_rates, abs=1e-9)
    assert rates.angular_acceleration == pytest.approx(now.angular_acceleration, abs=1e-9)
    for _ in range(50):
        rates.advance(HOVER, (1.0, -1.0, 0.5))
    assert rates.rates == pytest.approx((1.0, -1.0, 0.5), abs=0.1)
    assert rates.reserve(HOVER) > 0.0
