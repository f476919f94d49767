"""The estimator of the rotors' output finds weak rotors, and leaves sound vehicles as they are."""

from dataclasses import replace

import numpy as np
import pytest

from quadsim.dynamics.quadrotor import (
    Control,
    Delivered,
    LearnedModel,
    ModelParams,
    State,
    learned_step,
    quadrotor,
    step,
)
from quadsim.physics.domain_randomization import Randomization
from quadsim.sensing.estimation.nominal_rotors import Interval, Turning
from quadsim.sensing.estimation.prediction import Acted
from quadsim.sensing.estimation.vehicle_learner import VehicleLearner
from quadsim.sensing.estimation.wrench_learner import WrenchLearner
from quadsim.vehicle import GRAVITY, load_vehicle
from tests.sensing.random_flights import SWIFT, Ways, flown, weak

CRAZYFLIE = load_vehicle("cf21b_500")


def learned(vehicle, ways, seconds, dt=0.01, seed=0, gyro_noise=None, most=0.8):
    """Return the learner after a flight; with noise it has a gyroscope and an accelerometer."""
    learner = WrenchLearner(vehicle, ModelParams.of(vehicle), dt, gyro_noise)
    rng = np.random.default_rng(seed)
    rates = np.zeros(3)
    for before, after, u in flown(vehicle, ways, seconds, dt, seed, most):
        ends = [Turning(x.body_rates, x.angular_acceleration) for x in (before, after)]
        measured = learner.rotors.wrench_of(after.thrust, ends[1])
        if gyro_noise is not None:
            last, rates = rates, np.array(after.body_rates) + gyro_noise * rng.standard_normal(3)
            thrust = (before.thrust + after.thrust) / 2 + 0.3 * rng.standard_normal()
            mean = tuple(np.add(before.body_rates, after.body_rates) / 2)
            measured = learner.rotors.wrench_of(thrust, Turning(mean, tuple((rates - last) / dt)))
        learner.learn(Interval(*ends, Acted((u,), (1.0,)), dt), vehicle.thrust_max, measured)
    return learner


@pytest.mark.parametrize("rotor", range(4))
@pytest.mark.parametrize("share", [0.9, 0.7])
def test_a_weak_rotor_is_found_within_a_third_of_a_second(rotor, share):
    found = learned(SWIFT, Ways(weak(rotor, share)), 0.3).shares
    assert found == pytest.approx(weak(rotor, share), abs=0.02)


@pytest.mark.parametrize(("share", "gyro_noise"), [(0.7, None), (0.5, None), (0.7, 0.05)])
def test_a_rotor_that_fails_in_flight_is_found_as_fast(share, gyro_noise):
    """After two seconds the shares are known well, and yet they change by a third within 0.2 s."""
    ways = Ways(weak(2, share), since=2.0)
    found = learned(SWIFT, ways, 2.2, gyro_noise=gyro_noise).shares
    assert found == pytest.approx(weak(2, share), abs=0.05)


@pytest.mark.parametrize("seed", range(4))
def test_a_rotor_that_recovers_is_found_as_fast(seed):
    ways = Ways(weak(2, 0.7), since=1.0, until=2.0)
    assert learned(SWIFT, ways, 2.3, seed=seed).shares == pytest.approx((1.0,) * 4, abs=0.05)


@pytest.mark.parametrize("seed", range(8))
def test_lost_commands_leave_no_weak_rotors_behind(seed):
    found = learned(SWIFT, Ways(lost=(2.0, 2.3)), 2.45, seed=seed).shares
    assert found == pytest.approx((1.0,) * 4, abs=0.07)


def test_a_gyroscope_finds_a_weak_rotor_too():
    found = learned(SWIFT, Ways(weak(1, 0.7)), 0.5, gyro_noise=0.05).shares
    assert found == pytest.approx(weak(1, 0.7), abs=0.04)


def test_rotors_that_rise_and_fall_unequally_behind_a_led_loop_are_followed():
    """The periods are 20 ms, and rise and fall of the rotors differ."""
    sound = learned(CRAZYFLIE, Ways(), 2.0, dt=0.02)
    assert sound.shares == pytest.approx((1.0,) * 4, abs=0.01)
    found = learned(CRAZYFLIE, Ways(weak(2, 0.9)), 1.0, dt=0.02).shares
    assert found == pytest.approx(weak(2, 0.9), abs=0.03)


@pytest.mark.parametrize("seed", range(6))
def test_a_sound_vehicle_stays_sound(seed):
    """Lags and thrust differ from the nominal ones as in randomized flights."""
    thrust, rate_lag, motor_lag = np.random.default_rng(seed).uniform(-1.0, 1.0, 3)
    varied = Randomization(thrust=0.05 * thrust, rate_lag=0.2 * rate_lag, motor_lag=0.2 * motor_lag)
    assert learned(SWIFT, Ways(varied=varied), 2.0, seed=seed).delivered == Delivered()


def error(model: ModelParams, flight, dt=0.01) -> float:
    """Return the error of the model's next thrust and angular acceleration over a flight."""
    system = quadrotor(model, dt)
    scale = np.array([1.0, *model.tilt_cost, model.yaw_cost])
    off = []
    for before, after, u in flight:
        predicted = system.next(before, u)
        off.append(scale * np.subtract(predicted[13:], after[13:]))
    return float(np.sqrt(np.mean(np.square(off))))


def drawn_ways(seed):
    """Return a vehicle that differs in two ways from its model."""
    rng = np.random.default_rng(seed)
    ways = [
        {"strengths": tuple(rng.uniform(0.7, 1.0, 4))},
        {"turn": (*rng.uniform(-1.0, 1.0, 2), 0.0)},
        {"always": (0.0, 0.0, rng.uniform(-10.0, 10.0))},
        {"strengths": (rng.uniform(0.8, 1.0),) * 4},
        {"varied": Randomization(rate_lag=rng.uniform(-0.2, 0.3))},
        {"varied": Randomization(motor_lag=rng.uniform(-0.5, 1.0))},
        {"varied": Randomization(thrust=rng.uniform(-0.1, 0.1))},
    ]
    first, second = rng.choice(len(ways), 2, replace=False)
    return Ways(**(ways[first] | ways[second]))


@pytest.mark.parametrize("most", [0.8, 1.0])
@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(k, marks=pytest.mark.regression) for k in range(4, 12))]
)
def test_what_is_learned_is_never_worse_than_nothing(seed, most):
    ways = drawn_ways(seed)
    nominal = ModelParams.of(SWIFT)
    learner = learned(SWIFT, ways, 2.0, seed=seed, most=most)
    flight = list(flown(SWIFT, ways, 1.0, seed=seed + 100, most=most))
    model = LearnedModel.of_model(nominal, learner.delivered)
    assert error(model, flight) < 1.05 * error(nominal, flight)


@pytest.mark.parametrize("strengths", [weak(0, 0.9), weak(3, 0.7), (0.9,) * 4])
def test_the_highest_thrust_of_weak_rotors_is_what_they_are_asked_for(strengths):
    nominal = ModelParams.of(SWIFT)
    learner = VehicleLearner.for_exact_states(nominal, 0.01, vehicle=SWIFT)
    for before, after, u in flown(SWIFT, Ways(strengths), 3.0, most=1.0):
        learner.learn_from_states(before, after, Acted((u,), (1.0,)), 0.01)
    assert learner.numbers.thrust_max > 0.94 * nominal.thrust_max
    assert learner.model.tilt_first


def test_late_commands_do_not_make_a_known_mixer_one_that_gives_no_thrust_to_roll_and_pitch():
    """A planner that gives up thrust itself does not come to the limit, where it could learn it."""
    nominal = ModelParams.of(SWIFT)
    learner = VehicleLearner.for_exact_states(nominal, 0.01, vehicle=SWIFT)
    mistaken = VehicleLearner.for_exact_states(nominal, 0.01)
    was_mistaken = False
    for before, after, u in flown(SWIFT, Ways(delay=0.06), 3.0, most=1.2):
        for each in (learner, mistaken):
            each.learn_from_states(before, after, Acted((u,), (1.0,)), 0.01)
        assert learner.model.tilt_first
        was_mistaken |= not mistaken.model.tilt_first
    assert was_mistaken


def test_a_sound_vehicle_steps_as_without_learning():
    model = ModelParams.of(SWIFT)
    plain = quadrotor(model, 0.01)
    learning = quadrotor(LearnedModel.of_model(model, Delivered()), 0.01)
    for before, _, u in flown(SWIFT, Ways(), 0.5):
        assert learning.next(before, u) == plain.next(before, u)
    assert (plain.step, learning.step) == (step, learned_step)
    assert learning.rest == plain.rest


def test_the_learned_control_at_rest_does_not_turn_the_vehicle():
    turn = Delivered(turn_x=0.5, turn_y=-0.5)
    system = quadrotor(LearnedModel.of_model(ModelParams.of(SWIFT), turn), 0.01)
    x = State.of((0, 0, 0), (0, 0, 0), (1, 0, 0, 0), (0, 0, 0), system.rest[3], (0, 0, 0))
    for _ in range(100):
        x = system.next(x, system.rest)
    assert np.abs(x.body_rates).max() < 1e-9
    sound = replace(system, params=quadrotor(ModelParams.of(SWIFT), 0.01).params)
    assert np.abs(sound.next(x, system.rest).body_rates).max() > 1e-3


def test_the_highest_command_of_a_vehicle_with_a_weak_rotor_does_not_make_it_spin():
    """At full thrust the mixer gives up yaw; a sound vehicle may still be commanded all of it."""
    model = ModelParams.of(SWIFT)
    share = 0.075
    costs = (*model.tilt_cost, model.yaw_cost)
    turn_x, turn_y, turn_z = (share / c for c in costs)
    weak_rotor = Delivered(1.0 - share, turn_x, turn_y, turn_z)
    system = quadrotor(LearnedModel.of_model(model, weak_rotor), 0.01)

    def spin(thrust):
        """Return the yaw rate after a second at this thrust [rad/s]."""
        x = State.of((0, 0, 0), (0, 0, 0), (1, 0, 0, 0), (0, 0, 0), GRAVITY, (0, 0, 0))
        for _ in range(100):
            x = system.next(x, Control(0.0, 0.0, 0.0, thrust))
        return abs(x.wz)

    assert spin(system.high.thrust) < 3.5
    assert spin(model.thrust_max) > 7.0
    sound = quadrotor(LearnedModel.of_model(model, Delivered()), 0.01)
    assert sound.high.thrust == model.thrust_max
