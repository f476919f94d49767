"""Faults: what their texts mean, what the seed draws of them, and how rotors and commands fail."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from plant_cases import FULL, ROTORS, SKY, both_plants

from quadsim.course import load_course
from quadsim.physics.actuators import Actuators
from quadsim.physics.faults import (
    FACTORS,
    ROTOR_FACTORS,
    VECTORS,
    BiasJump,
    CommandFault,
    FactorFault,
    RotorFault,
    SensorFault,
    VectorFault,
    Window,
    drawn,
    first_lap,
    parse_fault,
)
from quadsim.physics.link import HOVER, FaultyCommands
from quadsim.streams import quadrotor_streams
from quadsim.vehicle import GRAVITY, Vehicle, load_vehicle

REST = (0.0, 0.0, 0.0)
DT = 1 / 400
RACER = Vehicle(
    name="racer",
    source="test",
    mass=0.75,
    inertia=(0.0025, 0.0021, 0.0043),
    radius=0.1,
    rate_tau=(0.06, 0.06, 0.2),
    omega_max=(10.0, 10.0, 4.0),
    thrust_max=4 * FULL / 0.75,
    drag=REST,
    latency=0.0,
    rotors=ROTORS,
)


def seeds(seed):
    return quadrotor_streams(seed).faults


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("rotor2=.5@3.2", RotorFault(2, 0.5, Window(3.2))),
        ("rotor2=lost@3.2-4", RotorFault(2, 0.0, Window(3.2, 0.8))),
        ("rotor=.7", RotorFault(None, 0.7, Window(None))),
        ("gyro=frozen@2-2.5", SensorFault("gyro", "frozen", Window(2.0, 0.5))),
        ("camera=lost~1", SensorFault("camera", "lost", Window(None, 1.0))),
        ("pixels=lost@1-2.2", SensorFault("pixels", "lost", Window(1.0, 1.2))),
        ("gyro=.1:0:-.2@3", BiasJump("gyro", (0.1, 0.0, -0.2), Window(3.0))),
        ("accelerometer=2", BiasJump("accelerometer", (2.0,), Window(None))),
        ("commands=lost@2~.1", CommandFault(inf, Window(2.0, 0.1))),
        ("commands=.04@2", CommandFault(0.04, Window(2.0))),
        ("motor2=2@1", RotorFault(2, 2.0, Window(1.0), "motor")),
        ("motor=1.5", RotorFault(None, 1.5, Window(None), "motor")),
        ("thrust=.9@1", FactorFault("thrust", 0.9, Window(1.0))),
        ("battery=.95@2-3", FactorFault("battery", 0.95, Window(2.0, 1.0))),
        ("mass=1.1@2", FactorFault("mass", 1.1, Window(2.0))),
        ("rate_gain=.8", FactorFault("rate_gain", 0.8, Window(None))),
        ("torque=0:0:.04@1", VectorFault("torque", (0.0, 0.0, 0.04), Window(1.0))),
        ("centre=.005:0@0", VectorFault("centre", (0.005, 0.0), Window(0.0))),
        ("centre=.01", VectorFault("centre", (0.01,), Window(None))),
    ],
)
def test_a_text_stands_for_a_fault_and_a_fault_gives_back_a_text(text, fault):
    assert parse_fault(text) == fault
    assert parse_fault(str(fault)) == fault


@pytest.mark.parametrize(
    "text",
    [
        "",
        "rotor2",
        "rotor0=.5",
        "rotor5=.5",
        "rotor2=",
        "rotor2=1.5",
        "rotor2=-1",
        "rotor2=nan",
        "rotor2=.5@",
        "rotor2=.5@x",
        "rotor2=.5@-1",
        "rotor2=.5@4-3",
        "rotor2=.5@3-3",
        "rotor2=.5@3-4~1",
        "rotor2=.5~0",
        "rotor2=.5@1@2",
        "rotor2=frozen",
        "camera=.5",
        "camera=blind",
        "gyro=lost",
        "gyro=.1:0",
        "gyro=inf",
        "imu=.1",
        "commands=frozen",
        "engine=lost",
        "motor5=2",
        "motor1=0",
        "motor1=lost",
        "mass=0",
        "mass=lost",
        "thrust=1.1",
        "battery=.1",
        "rate_gain=frozen",
        "torque=1:2",
        "torque=11",
        "centre=0:0:0",
        "centre=1",
        "rotor2=.5@2\n",
    ],
)
def test_a_wrong_text_is_refused_in_one_line_that_quotes_it(text):
    if text.endswith("\n"):
        # White space around a text is no part of it.
        assert parse_fault(text) == parse_fault(text.strip())
        return
    with pytest.raises(ValueError, match=r".") as error:
        parse_fault(text)
    assert "\n" not in str(error.value)
    assert repr(text) in str(error.value)


def test_a_fault_lasts_from_its_start_until_just_before_its_end():
    window = parse_fault("rotor2=.5@3.2-4").window
    steps = [k * DT for k in range(2000) if window.active(k * DT)]
    assert (steps[0], len(steps)) == (pytest.approx(3.2), 320)
    assert Window(1.0, inf).active(1e9)
    assert not Window(1.0, inf).active(1.0 - 1e-6)


def wrench_of(faults, steps, commands=None):
    """Return force and torque of each step of an airframe that is held still.  (steps, 6)"""
    actuators = Actuators(RACER, DT, [parse_fault(text) for text in faults])
    rows = []
    for k in range(steps):
        force, torque = actuators.wrench(HOVER if commands is None else commands[k], REST, REST)
        rows.append((*force, *torque))
    return np.array(rows)


def test_a_weak_rotor_takes_its_share_of_thrust_and_torque_for_as_long_as_it_is_weak():
    rows = wrench_of(["rotor2=.25@.1-.2"], 120)
    lost = 0.75 * RACER.mass * GRAVITY / 4
    x, y = ROTORS.positions[1]
    reaction = ROTORS.spin[1] * ROTORS.kappa * lost
    weak = [0.0, 0.0, RACER.mass * GRAVITY - lost, -y * lost, x * lost, -reaction]
    sound = [0.0, 0.0, RACER.mass * GRAVITY, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(rows[:40], [sound] * 40, atol=1e-12)
    np.testing.assert_allclose(rows[40:80], [weak] * 40, atol=1e-12)
    np.testing.assert_allclose(rows[80:], [sound] * 40, atol=1e-12)


def test_two_faults_of_a_rotor_multiply_and_faults_of_all_scale_the_wrench():
    np.testing.assert_array_equal(
        wrench_of(["rotor1=.5@0", "rotor1=.5@0"], 5), wrench_of(["rotor1=.25@0"], 5)
    )
    rng = np.random.default_rng(1)
    commands = rng.uniform((-5, -5, -2, 2), (5, 5, 2, 30), (200, 4))
    weak = wrench_of([f"rotor{k}=.5@0" for k in (1, 2, 3, 4)], 200, commands)
    np.testing.assert_allclose(weak, 0.5 * wrench_of([], 200, commands), rtol=1e-12, atol=1e-12)


def test_a_fault_to_come_changes_no_bit():
    commands = np.random.default_rng(2).uniform((-5, -5, -2, 2), (5, 5, 2, 30), (200, 4))
    sound = wrench_of([], 200, commands)
    later = wrench_of(["rotor3=lost@.25"], 200, commands)
    assert (later[:100] == sound[:100]).all()
    assert (later[100:, 2] < sound[100:, 2]).all()


def test_a_slow_motor_takes_as_long_as_its_factor_says():
    """A command steps by the same amount at both lags."""
    commands = [(0.0, 0.0, 0.0, 12.0)] * 80
    fast = wrench_of([], 80, commands)[:, 2]
    slow = wrench_of([f"motor{k}=2@0" for k in (1, 2, 3, 4)], 160, commands * 2)[:, 2]
    np.testing.assert_allclose(slow[1::2], fast, rtol=1e-9)


def test_an_empty_battery_lowers_the_highest_thrust_alone():
    full = (0.0, 0.0, 0.0, RACER.thrust_max)
    share = wrench_of(["battery=.9@0"], 400, [full] * 400)[-1, 2] / (4 * FULL)
    assert share == pytest.approx(0.9**2)
    low = [(0.0, 0.0, 0.0, 0.7 * RACER.thrust_max)] * 100
    np.testing.assert_array_equal(wrench_of(["battery=.9@0"], 100, low), wrench_of([], 100, low))


def test_a_payload_divides_the_force_and_a_weak_thrust_multiplies_it():
    commands = np.random.default_rng(1).uniform((-5, -5, -2, 2), (5, 5, 2, 30), (200, 4))
    sound = wrench_of([], 200, commands)
    heavy = wrench_of(["mass=1.25@0"], 200, commands)
    np.testing.assert_allclose(heavy[:, :3], sound[:, :3] / 1.25, rtol=1e-12)
    np.testing.assert_array_equal(heavy[:, 3:], sound[:, 3:])
    weak = wrench_of(["thrust=.8@0"], 200, commands)
    np.testing.assert_allclose(weak, 0.8 * sound, rtol=1e-12, atol=1e-12)


def test_a_rate_loop_with_half_its_gain_asks_for_half_the_torque():
    turn = [(1.0, -1.0, 0.0, GRAVITY)] * 3
    np.testing.assert_allclose(
        wrench_of(["rate_gain=.5@0"], 3, turn)[0, 3:5],
        0.5 * wrench_of([], 3, turn)[0, 3:5],
        rtol=0.1,
    )


def test_a_torque_acts_as_given_and_a_centre_of_mass_ahead_lifts_the_tail():
    """Thrust behind the centre of mass pushes the tail up, which turns the nose down, about +y."""
    weight = RACER.mass * GRAVITY
    pushed = wrench_of(["torque=.01:-.02:.03@0"], 1)[0]
    np.testing.assert_allclose(pushed, [0.0, 0.0, weight, 0.01, -0.02, 0.03], atol=1e-12)
    ahead = wrench_of(["centre=.005:0@0"], 1)[0]
    np.testing.assert_allclose(ahead, [0.0, 0.0, weight, 0.0, 0.005 * weight, 0.0], atol=1e-12)
    left = wrench_of(["centre=0:.005@0"], 1)[0]
    np.testing.assert_allclose(left, [0.0, 0.0, weight, -0.005 * weight, 0.0, 0.0], atol=1e-12)


def test_every_part_of_the_vehicle_has_a_fault_that_changes_the_wrench():
    texts = [f"{part}={factors.low or 0.5:g}@0" for part, factors in FACTORS.items()]
    texts += [f"{part}2=.5@0" for part in ROTOR_FACTORS]
    texts += [f"{part}={':'.join(['.01'] * vectors.size)}@0" for part, vectors in VECTORS.items()]
    commands = [(3.0, -3.0, 1.0, RACER.thrust_max)] * 40
    sound = wrench_of([], 40, commands)
    for text in texts:
        assert (wrench_of([text], 40, commands) != sound).any(), text


@pytest.mark.parametrize("kind", both_plants)
def test_a_vehicle_turns_over_to_the_side_of_a_lost_rotor(kind):
    front_left = parse_fault("rotor3=lost@.1")
    plant = kind(SKY, load_vehicle("swift"), faults=[front_left])
    for _ in range(40):
        x = plant.step((0.0, 0.0, 0.0, GRAVITY)).x
    assert max(map(abs, x.body_rates)) < 1e-9
    for _ in range(20):
        x = plant.step((0.0, 0.0, 0.0, GRAVITY)).x
    plant.close()
    # Its left side and its nose go down.
    assert x.wx < -1.0
    assert x.wy > 1.0
    assert x.thrust < GRAVITY


def test_a_seed_draws_the_same_faults_again_and_another_seed_others():
    faults = [parse_fault(text) for text in ("rotor=.5", "gyro=.2~.5", "commands=lost~.1")]
    first = drawn(faults, seeds(0), 5.0)
    assert drawn(faults, seeds(0), 5.0) == first
    assert not set(drawn(faults, seeds(1), 5.0)) & set(first)
    assert {fault.window.start for fault in first} - {None} == {f.window.start for f in first}
    assert len({fault.window.start for fault in first}) == 3


def test_what_is_drawn_for_a_fault_does_not_depend_on_what_it_is_or_on_those_after_it():
    rotor, jump, loss = (parse_fault(text) for text in ("rotor=.5", "gyro=.2", "commands=lost~.1"))
    starts = {drawn([f], seeds(4), 5.0)[0].window.start for f in (rotor, jump, loss)}
    assert starts == {drawn([loss, rotor, jump], seeds(4), 5.0)[0].window.start}


def test_draws_are_uniform_over_times_rotors_and_directions():
    faults = [parse_fault(text) for text in ("rotor=.5", "gyro=.2", "centre=.005")]
    found = [drawn(faults, seeds(seed), 5.0) for seed in range(400)]
    times = np.array([fault.window.start for fault, _, _ in found])
    assert 0.0 <= times.min() < 0.1
    assert 4.9 < times.max() <= 5.0
    np.testing.assert_allclose(np.quantile(times, [0.25, 0.5, 0.75]), [1.25, 2.5, 3.75], atol=0.4)
    counts = np.bincount([fault.rotor for fault, _, _ in found], minlength=5)[1:]
    assert (abs(counts - 100) < 35).all()
    centres = np.array([fault.vector for _, _, fault in found])
    np.testing.assert_allclose(np.linalg.norm(centres, axis=1), 0.005, atol=2e-6)
    np.testing.assert_allclose(centres.mean(axis=0), 0.0, atol=0.001)
    jumps = np.array([fault.jump for _, fault, _ in found])
    np.testing.assert_allclose(np.linalg.norm(jumps, axis=1), 0.2, atol=2e-4)
    np.testing.assert_allclose(jumps.mean(axis=0), 0.0, atol=0.03)


def test_what_is_given_is_not_drawn():
    given = [parse_fault(text) for text in ("rotor2=.5@3.2", "gyro=0:0:.1@1-2")]
    assert drawn(given, seeds(0), 5.0) == tuple(given)


def test_the_time_of_the_first_lap_is_near_the_time_it_takes():
    """One lap from a standing start takes 5.2 s (docs/sensing.md); most faults fall into it."""
    assert 4.6 < first_lap(load_course("split_s_swift"), load_vehicle("swift")) < 5.2
    weak = replace(RACER, thrust_max=0.9 * GRAVITY)
    assert np.isfinite(first_lap(SKY, weak))


def test_the_last_command_that_arrived_stays_in_force_while_others_are_lost():
    losses = [CommandFault(inf, Window(0.0, 0.2)), CommandFault(inf, Window(0.5, 0.3))]
    faulty = FaultyCommands(losses)
    arrived = [faulty.carried(0.1 * k, (float(k),)) for k in range(10)]
    assert arrived[:2] == [HOVER, HOVER]
    assert [u for (u,) in arrived[2:]] == [2, 3, 4, 4, 4, 4, 8, 9]


def test_commands_arrive_late_while_they_are_delayed():
    faulty = FaultyCommands([CommandFault(0.2, Window(0.3, 0.4))])
    arrived = [faulty.carried(0.1 * k, (float(k),)) for k in range(10)]
    assert [u for (u,) in arrived] == [0, 1, 2, 2, 2, 3, 4, 7, 8, 9]
