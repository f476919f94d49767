"""Claims about the controller by which a person flies."""

from math import radians

import numpy as np
import pytest

import quadsim
from quadsim.config.recorded import RecordError
from quadsim.config.spec import Spec
from quadsim.dynamics.quadrotor import Control
from quadsim.racing.events import NO_PROGRESS
from quadsim.racing.hand import HAND, SILENCE, SINKING, Hand, HandRates, Rates, Sticks
from quadsim.report.report import report
from quadsim.vehicle import GRAVITY, load_vehicle

SWIFT = load_vehicle("swift")
RATES = HandRates.of(SWIFT)


class Clock:
    """A clock that is set by hand."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def test_full_sticks_turn_as_a_pilot_expects_and_a_vehicle_can():
    right = RATES.control(Sticks(roll=1.0, pitch=1.0, yaw=1.0, throttle=1.0))
    assert right == pytest.approx((*SWIFT.omega_max[:2], -SWIFT.omega_max[2], SWIFT.thrust_max))
    left = RATES.control(Sticks(roll=-1.0, pitch=-1.0, yaw=-1.0))
    assert left == pytest.approx((-right.wx, -right.wy, -right.wz, 0.0))


def test_expo_leaves_the_middle_and_the_end_of_a_stick():
    linear, bent = Rates(expo=0.0), Rates(expo=0.8)
    assert bent.rate(1.0) == linear.rate(1.0) == pytest.approx(radians(670.0))
    assert bent.rate(1e-6) / 1e-6 == pytest.approx(radians(70.0), rel=1e-3)
    assert 0.0 < bent.rate(0.5) < linear.rate(0.5)


def test_the_throttle_of_hovering_gives_the_weight():
    assert RATES.control(Sticks(throttle=RATES.hover)).thrust == pytest.approx(GRAVITY)


def test_a_vehicle_hovers_before_it_begins_and_sinks_without_sticks():
    clock = Clock()
    hand = Hand(RATES, clock)
    hand.move(Sticks(roll=1.0, throttle=1.0))
    assert list(hand.control(None)[0]) == [0.0, 0.0, 0.0, GRAVITY]
    hand.begin()
    assert hand.control(None)[0][0] == pytest.approx(SWIFT.omega_max[0])
    clock.now += 0.99 * SILENCE
    assert hand.sticks is not None
    clock.now += 0.02 * SILENCE
    assert hand.sticks is None
    assert Control(*hand.control(None)[0]) == (0.0, 0.0, 0.0, SINKING)
    assert SINKING < GRAVITY
    hand.move(Sticks(yaw=1.0, throttle=0.5))
    assert hand.control(None)[0][2] < 0.0


@pytest.fixture(scope="module")
def run():
    """Half a second with the roll stick to the right."""
    clock = Clock()
    hand = Hand(RATES, clock)
    hand.move(Sticks(roll=0.5, throttle=0.6))
    hand.begin()
    return quadsim.fly("figure8", controller=hand, timeout=0.5)


def test_a_run_keeps_who_flew_and_what_was_asked_for(run, tmp_path):
    asked = RATES.control(Sticks(roll=0.5, throttle=0.6))
    assert np.allclose(run.telemetry["wx_cmd"], asked.wx)
    assert np.allclose(run.telemetry["a_cmd"], asked.thrust)
    assert run.telemetry["wx"][-1] > 0.5 * asked.wx
    assert run.spec["sampler"] == HAND
    assert run.spec[HAND]["roll"] == {**RATES.roll._asdict()}
    assert run.spec["own"] == {}
    folder = run.save(tmp_path)
    (row,) = quadsim.runs(tmp_path)
    assert (row.sampler, row.path) == (HAND, folder)
    again = quadsim.load_run(folder)
    assert again.digest() == run.digest()
    assert "sticks of a person" in str(again)
    assert "a person flew it" in "\n".join(str(part) for part in report(again, None, 80))


def test_a_run_of_a_person_cannot_be_flown_again(run):
    with pytest.raises(RecordError, match="hand"):
        Spec.of_record(run.spec)


def test_a_person_has_longer_to_turn_round_than_a_planner(run):
    spec = quadsim.Spec.of("figure8")
    assert spec.stuck_after == NO_PROGRESS
    assert spec.but(controller=Hand(RATES)).stuck_after > 2 * NO_PROGRESS
