"""What a configuration cannot give is a limit of the planner's model."""

from math import radians

import numpy as np
import pytest

import quadsim
from quadsim.firmware.configuration import Configuration
from quadsim.firmware.identification import (
    Identification,
    NoResponseError,
    RateLoop,
    Response,
    _check_responses,
    check_explained,
    weak_yaw,
)
from quadsim.firmware.identified import firmware_for
from quadsim.firmware.limits import nominal_behind
from quadsim.firmware.switches import Switches
from quadsim.firmware.text import Text, shipped_configuration
from quadsim.firmware.translation import ConfigurationError
from quadsim.firmware.tuned_gains import first_configuration
from quadsim.vehicle import load_vehicle, vehicle_names

ARM = "aux 0 0 0 1700 2100 0 0"
SWIFT = load_vehicle("swift")
NOMINAL = quadsim.dynamics.quadrotor.ModelParams.of(SWIFT)
CONFIGURED = [n for n in vehicle_names() if shipped_configuration(load_vehicle(n))]


def limits(rates=(12.0, 12.0, 12.0), motors=(0.055, 1.0)):
    """Return the model behind a configuration with these ends of its curves."""
    switches = Switches((1000.0,) * 12, (1000.0,) * 12)
    ends = np.array([1000.0, 2000.0])
    curves = np.array([[-rate, rate] for rate in rates])
    made = Configuration(b"", switches, ends, curves, ends, np.array(motors))
    return nominal_behind(SWIFT, made, "mine.txt")


def test_a_configuration_that_gives_all_that_the_vehicle_has_limits_nothing():
    assert limits() == NOMINAL
    assert limits(motors=(0.055, 0.9999)) == NOMINAL


def test_rates_and_thrust_end_where_the_curves_end():
    assert limits(rates=(3.0, -4.0, 2.0)).rate_max == pytest.approx((2.94, 3.92, 1.96))
    rotors = SWIFT.rotors
    half = 4.0 * rotors.thrust(0.5 * rotors.motor_omega_max) / SWIFT.mass
    fifth = 4.0 * rotors.thrust(0.2 * rotors.motor_omega_max) / SWIFT.mass
    found = limits(motors=(0.2, 0.7))
    assert found.thrust_min == pytest.approx(fifth)
    assert limits(motors=(0.0, 0.6)).thrust_max == pytest.approx(0.36 * NOMINAL.thrust_max, rel=0.1)
    assert half < found.thrust_max < NOMINAL.thrust_max


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"rates": (5.0, 0.0, 5.0)}, "expected a stick of pitch that commands body rates"),
        ({"motors": (0.055, 0.3)}, "expected thrusts from below to above gravity"),
        ({"motors": (0.6, 1.0)}, "expected thrusts from below to above gravity"),
    ],
)
def test_a_configuration_that_cannot_fly_the_vehicle_is_one_line(changes, said):
    with pytest.raises(ConfigurationError, match=said) as caught:
        limits(**changes)
    assert str(caught.value).startswith("mine.txt: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", CONFIGURED)
def test_the_configuration_of_a_vehicle_does_not_limit_it(built, name):
    vehicle = load_vehicle(name)
    _, configuration = firmware_for(vehicle, first_configuration(vehicle))
    model = quadsim.dynamics.quadrotor.ModelParams.of(vehicle)
    assert nominal_behind(vehicle, configuration, "x") == model


@pytest.mark.parametrize(
    ("lines", "thrust", "rates"),
    [
        (("set motor_output_limit = 80",), 26.5, (10.0, 10.0, 6.0)),
        (("set throttle_limit_type = CLIP", "set throttle_limit_percent = 80"), 26.5, (10, 10, 6)),
        (
            (
                *("set roll_rc_rate = 15", "set roll_srate = 15", "set pitch_rc_rate = 15"),
                *("set pitch_srate = 15", "set yaw_rc_rate = 9", "set yaw_srate = 9"),
            ),
            NOMINAL.thrust_max,
            tuple(0.98 * radians(rate) for rate in (150.0, 150.0, 90.0)),
        ),
    ],
    ids=["output", "clip", "rates"],
)
def test_a_flight_within_the_limits_of_its_configuration_finishes(built, lines, thrust, rates):
    own = Text("mine.txt", (ARM, *lines))
    settings = {"flight_controller": "betaflight", "betaflight": own, "laps": 1, "samples": 512}
    run = quadsim.fly("figure8", **settings)
    assert run.spec["model"]["thrust_max"] == pytest.approx(thrust, rel=0.01)
    assert run.spec["model"]["rate_max"] == pytest.approx(rates, rel=0.01)
    assert run.outcome == "finished"
    given = quadsim.Spec.of("figure8", **settings, model_thrust_max=20.0)
    assert given.model.thrust_max == 20.0


# ---- the test bench ----


def first_order(tau, gain=1.0):
    """Return commands, and what follows them with a lag [s]."""
    random = np.random.default_rng(3)
    command = np.repeat(random.uniform(-1.0, 1.0, 30), 10)
    measured = np.zeros_like(command)
    for k in range(1, len(command)):
        measured[k] = measured[k - 1] + (gain * command[k - 1] - measured[k - 1]) * 0.01 / tau
    return Response(command, measured)


GOOD = first_order(0.05)


@pytest.mark.parametrize(
    ("part", "bad", "said"),
    [
        (
            0,
            Response(GOOD.command, -GOOD.measured),
            "roll rate .* but it goes",
        ),
        (1, Response(GOOD.command, 0.0 * GOOD.measured), "pitch rate .* does not answer"),
        (2, Response(GOOD.command, np.full(300, np.inf)), "yaw rate .* grows without end"),
        (3, Response(GOOD.command, np.cos(np.arange(300.0))), "thrust .* goes elsewhere"),
    ],
)
def test_a_vehicle_that_does_not_follow_its_commands_is_one_line(part, bad, said):
    _check_responses([GOOD] * 4, 0.01)
    responses = [GOOD] * 4
    responses[part] = bad
    with pytest.raises(NoResponseError, match=said) as caught:
        _check_responses(responses, 0.01)
    assert "\n" not in str(caught.value)


def identification(roll=0.98, yaw=0.98, thrust=0.98):
    """Return an identification that explains these shares."""
    loops = [RateLoop(0.03, 0.03, share) for share in (roll, 0.98, yaw)]
    return Identification(*loops, thrust_lag=0.03, thrust_explained=thrust, delay=0.0)


def test_a_model_that_explains_little_is_refused_and_says_what_was_measured():
    check_explained(identification())
    for changes, said in (
        ({"thrust": 0.079}, "of the thrust after commands, but the best one explains 7.9 %"),
        ({"roll": -3.0}, "of the roll rate after commands, but the best one explains 0 %"),
        ({"roll": float("nan")}, "of the roll rate"),
    ):
        with pytest.raises(NoResponseError, match=said):
            check_explained(identification(**changes))
    # A yaw that swings flies, with a warning.
    check_explained(identification(yaw=0.3))
    assert weak_yaw(identification(yaw=0.3), NOMINAL)
    assert not weak_yaw(identification(), NOMINAL)


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        (("roll", "pitch", "yaw"), "expected the roll rate to follow its command"),
        (("yaw",), "expected the yaw rate to follow its command"),
    ],
)
def test_a_vehicle_without_gains_is_one_line(built, axes, said):
    lines = [f"set {letter}_{axis} = 0" for letter in "pidf" for axis in axes]
    own = Text("mine.txt", (ARM, *lines))
    with pytest.raises(NoResponseError, match=said) as caught:
        quadsim.Spec.of("figure8", flight_controller="betaflight", betaflight=own)
    assert str(caught.value).startswith("mine.txt: swift on a bench: ")
    assert "\n" not in str(caught.value)
