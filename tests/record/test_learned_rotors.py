"""A run tells which rotors were found to be weak, how late commands came, and since when."""

from dataclasses import replace

import numpy as np
import pytest

import quadsim
from quadsim.record.archive import read_run
from quadsim.record.run import LearnedDelay, LearnedRotor, RecordedRun
from quadsim.report.run_text import learned_text
from tests.run_cases import SPEC, frame, save
from tests.small import SMALL


def flown(*shares):
    """Return a run in which each frame has these shares of the second rotor."""
    frames = [
        replace(frame(k), rotor_shares=(1.0, share, 1.0, 1.0)) for k, share in enumerate(shares)
    ]
    return RecordedRun.from_frames(SPEC, frames)


def test_a_weak_rotor_is_told_with_its_last_share_and_the_time_since_when():
    run = flown(1.0, 0.99, 0.93, 0.91)
    assert run.learned == (LearnedRotor(rotor=2, share=0.91, since=pytest.approx(0.02)),)
    assert learned_text(run) == "rotor 2 at 91 %, from 0.0 s"


def test_a_rotor_that_has_come_back_is_not_told():
    assert flown(1.0, 0.8, 0.97).learned == ()


def late(*delays):
    """Return a run in which commands are this late in each frame [s]."""
    frames = [replace(frame(k), learned_delay=delay) for k, delay in enumerate(delays)]
    return RecordedRun.from_frames(SPEC, frames)


def test_a_delay_is_told_with_the_time_since_when(tmp_path):
    run = late(0.0, 0.03, 0.04, 0.04)
    assert run.learned_delay == LearnedDelay(0.04, since=pytest.approx(0.02))
    assert learned_text(run) == "commands 40 ms late, from 0.0 s"
    assert run.telemetry["delay"].tolist() == [0.0, 0.03, 0.04, 0.04]
    assert read_run(save(tmp_path, run)).learned_delay == run.learned_delay
    assert late(0.0, 0.04, 0.0).learned_delay is None


def test_what_was_learned_is_stored(tmp_path):
    run = flown(0.9, 0.7)
    assert read_run(save(tmp_path, run)).learned == run.learned
    sound = flown(1.0, 1.0)
    assert read_run(save(tmp_path, sound)).learned == ()


@pytest.mark.compiled
def test_a_flight_with_a_weak_rotor_tells_it():
    run = quadsim.fly("figure8", vehicle="swift", **SMALL, timeout=1.0, fault="rotor2=.8@.2")
    [(rotor, share, since)] = run.learned
    assert rotor == 2
    assert share == pytest.approx(0.8, abs=0.03)
    assert 0.2 < since < 0.4
    assert learned_text(run) in str(run)
    assert not quadsim.fly("figure8", vehicle="swift", **SMALL, timeout=0.5).learned
    shares = run.telemetry["share2"]
    assert np.all(np.abs(shares[run.telemetry["t"] < 0.2] - 1.0) < 0.02)
    assert shares[-1] == share
    told_nothing = quadsim.fly(
        "figure8", vehicle="swift", **SMALL, timeout=0.5, fault="rotor2=.8@.2", adapt=False
    )
    assert not told_nothing.learned
    assert np.all(told_nothing.telemetry["share2"] == 1.0)
