"""Adaptation: the errors of the estimates are as large as their deviations say, and small after two seconds."""

from contextlib import closing
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from controllers.adaptation import Adaptation
from quadsim.course import load_course
from quadsim.physics.domain_randomization import DRAG, GUST, MASS, Randomization, gusts
from quadsim.physics.plant import PLANTS, default_plant, start_state
from quadsim.physics.rotorpy_plant import RotorpyPlant
from quadsim.race.build import build, launch, planner_of
from quadsim.race.spec import Spec
from quadsim.systems.quadrotor import ModelParams, quadrotor
from quadsim.vehicle import GRAVITY, load_vehicle

DT = 0.01
SWIFT = load_vehicle("swift")
NOMINAL = ModelParams.of(SWIFT)


def simulated(seed, gust=GUST, steps=200):
    """States of a vehicle that tumbles at changing thrust, by the law that the filter assumes, and its true k and d."""
    rng = np.random.default_rng(seed)
    k, d = 1 + MASS * rng.uniform(-1, 1), NOMINAL.drag * (1 + DRAG * rng.uniform(-1, 1))
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


def errors(gust, seeds=40):
    """Of k and d after 2 s, in standard deviations as the filter has them, and of k as a share.  (seeds, 3)"""
    found = []
    for seed in range(seeds):
        states, k, d = simulated(seed, gust)
        adaptation = Adaptation(NOMINAL, DT)
        for i, x in enumerate(states):
            adaptation.observe(x, np.zeros(4), int(i > 0))
        off = np.array([adaptation.model.thrust_gain - k, adaptation.model.drag - d])
        found.append([*off / adaptation.std, off[0]])
    return np.array(found)


def test_errors_are_as_large_as_the_filter_says():
    off = errors(GUST)
    mean_square = np.mean(off[:, :2] ** 2, axis=0)  # chi^2 with 40 degrees of freedom: .5 to 1.7 is 99.8 %
    assert np.all((mean_square > 0.4) & (mean_square < 1.8)), mean_square
    assert np.abs(off[:, 2]).max() < 0.02 < MASS


def test_a_wind_beyond_its_prior_makes_errors_beyond_its_deviations():
    assert np.mean(errors(4 * GUST)[:, :2] ** 2) > 4


@pytest.mark.parametrize("share", [-0.05, 0.0])
def test_the_highest_thrust_is_what_the_rotors_gave_when_asked_for_more(share):
    full = np.array([0.0, 0.0, 0.0, NOMINAL.thrust_max])
    assert _highest(share, full) == pytest.approx((1 + share) * NOMINAL.thrust_max, rel=0.01)


def test_rotors_that_follow_say_nothing_about_their_limit():
    assert _highest(-0.05, np.array([0.0, 0.0, 0.0, 0.9 * NOMINAL.thrust_max])) == NOMINAL.thrust_max


def _highest(share, u):
    """Estimated after half a second straight up [m/s^2]."""
    adaptation = Adaptation(NOMINAL, DT)
    course = replace(load_course("figure8"), bounds=((-99, 99), (-99, 99), (-1, 99)))
    with closing(PLANTS[default_plant()](course, Randomization(thrust=share).vehicle(SWIFT))) as plant:
        for i in range(50):
            adaptation.observe(np.array(plant.state.x), u, int(i > 0))
            for _ in range(4):
                plant.step(tuple(u))
    return adaptation.model.thrust_max


def learnt_at_full_thrust(plant, vehicle, tilt=3.0):
    """The model after 1.5 s at full thrust, rolling and pitching one way and the other at `tilt` [rad/s]."""
    adaptation, full = Adaptation(ModelParams.of(vehicle), DT), 0.99 * vehicle.thrust_max
    with closing(plant(load_course("figure8"), vehicle)) as plant:
        for i in range(150):
            rate = tilt * (-1) ** (i // 15)
            u = (rate, -rate, 0.0, full)
            for _ in range(4):
                plant.step(u)
            adaptation.observe(np.array(plant.state.x), np.array(u), int(i > 0))
    return adaptation.model


@pytest.mark.parametrize("name", ["swift", "crazyflie", "cpc"])
def test_whether_the_flight_controller_gives_up_thrust_to_tilt_is_learnt(name):
    vehicle = load_vehicle(name)
    assert learnt_at_full_thrust(PLANTS[default_plant()], vehicle).tilt_first
    if find_spec("rotorpy"):
        assert not learnt_at_full_thrust(RotorpyPlant, vehicle).tilt_first
        assert learnt_at_full_thrust(RotorpyPlant, vehicle, tilt=0.0).tilt_first, "nothing was seen of it"


def test_a_planner_that_has_to_gives_up_thrust_to_roll_and_pitch():
    x, u = launch_state(), (4.0, -3.0, 1.0, NOMINAL.thrust_max)
    system = quadrotor(replace(NOMINAL, tilt_first=False), DT)
    assert quadrotor(NOMINAL, DT).attainable is None
    wx, wy, wz, a = system.attainable(x, u, system.params)
    assert (wx, wy, wz) == u[:3]
    after = system.step(x, (wx, wy, wz, a), system.params, DT)
    assert after == pytest.approx(system.step(x, u, system.params, DT)), "the model gives up the same"
    assert a < 0.97 * NOMINAL.thrust_max
    level = (0.0, 0.0, 1.0, NOMINAL.thrust_max)
    assert system.attainable(x, level, system.params) == level


def test_what_is_commanded_is_what_the_vehicle_can_follow():
    spec = Spec.of("paper_flat", vehicle="swift", preset="race", samples=128, horizon=50)
    mppi, x = planner_of(spec, spec.streams.planner), np.array(launch_state())
    mppi.plan[0] = 4.0, -3.0, 0.0, NOMINAL.thrust_max
    asked = mppi.command(x)
    assert asked == pytest.approx(mppi.clipped(mppi.plan[0]))
    mppi.set_model(quadrotor(replace(NOMINAL, tilt_first=False), DT))
    assert mppi.command(x)[3] < asked[3] - 1.0


def launch_state():
    return tuple(start_state(load_course("figure8").start, 0.1))


def test_a_flight_with_a_vehicle_too_heavy_learns_it():
    small = {"samples": 128, "horizon": 50, "iterations": 1, "target_ess": 20}
    spec = Spec.of("paper_flat", vehicle="swift", preset="race", **small, timeout=1.5, randomize=1.0, seed=4)
    plant, mppi, referee = build(spec)
    with closing(plant):
        *_, last = launch(spec, plant, mppi, referee)
    mass = spec.record()["variation"]["mass"]
    assert mass > 0.03
    assert last.t == pytest.approx(1.5)
    assert mppi.adaptation.model.thrust_gain == pytest.approx(1 / (1 + mass), abs=0.015)
    assert mppi.system.params == mppi.adaptation.observe(np.array(last.x), mppi.plan[0], 0).params
    successor = planner_of(spec, spec.streams.planner)
    successor.continue_from(mppi)
    assert successor.adaptation is mppi.adaptation, "a planner that takes over keeps the estimates"
