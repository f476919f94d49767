"""Each configuration turns its vehicle as it is commanded, and the search finds such gains."""

import json
import os
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from quadsim.cli.cli import race
from quadsim.firmware import gain_search
from quadsim.firmware.gain_search import StepResponse, shortfall, wanted_response
from quadsim.firmware.gains import AXIS_NAMES, Gains, gains_of, with_gains
from quadsim.firmware.text import Text, read_text
from quadsim.firmware.tuned_gains import FirmwareBench, first_configuration, plain_configuration
from quadsim.vehicle import VEHICLES, load_vehicle, vehicle_names

DT = 1e-3
PERIOD = 0.01
ARM = "aux 0 0 0 1700 2100 0 0"
GAINS = (Gains(20, 21, 22), Gains(30, 31, 32), Gains(40, 41, 0))
# Crazyflies have a firmware of their own, and nobody has measured an Archer to tune one for.
WITHOUT = {"archer", "cf21b_500"}
WITH_ROTORS = [n for n in vehicle_names() if load_vehicle(n).rotors and n not in WITHOUT]
# found by step responses; swift's were chosen by its lap times
TUNED = sorted(set(WITH_ROTORS) - {"swift", "swift_40ms"})


@cache
def bench(name, text=None):
    """Return the test bench of a vehicle."""
    vehicle = load_vehicle(name)
    return FirmwareBench(vehicle, text or first_configuration(vehicle), DT, PERIOD)


@cache
def response(name, axis):
    """Return the step response of an axis with the configuration of a vehicle."""
    return bench(name).response(axis)


def test_each_vehicle_with_rotors_has_a_configuration_but_those_without_a_tuned_one():
    files = {path.name.partition(".")[0] for path in VEHICLES.glob("*.betaflight.txt")}
    assert files == set(WITH_ROTORS)


@pytest.mark.parametrize("name", WITH_ROTORS)
def test_the_sticks_of_a_configuration_cover_the_rates_of_its_vehicle(built, name):
    found = bench(name)
    largest = np.abs(found.configuration.rates).max(axis=1)
    assert (largest >= np.array(found.vehicle.omega_max) - 1e-6).all()


@pytest.mark.parametrize("name", WITH_ROTORS)
def test_body_rates_reach_their_command(built, name):
    for axis in range(3):
        found = response(name, axis)
        assert abs(found.settled_error) < 0.12
        assert found.rise_time < 0.4


@pytest.mark.parametrize("name", TUNED)
def test_roll_and_pitch_overshoot_little_and_yaw_less_than_with_the_stock_gains(built, name):
    plain = bench(name, plain_configuration(load_vehicle(name)))
    roll, pitch, yaw = (response(name, axis).overshoot for axis in range(3))
    assert roll < 0.12
    assert pitch < 0.12
    assert yaw < 0.3
    assert plain.response(2).overshoot > 1.0


def test_the_configuration_of_swift_40ms_is_that_of_swift():
    lines = [
        [line for line in read_text(VEHICLES / f"{name}.betaflight.txt").lines if "#" not in line]
        for name in ("swift", "swift_40ms")
    ]
    assert lines[0] == lines[1]


def test_gains_of_a_text_are_replaced_and_missing_ones_added_before_it_is_saved():
    text = Text("x", (ARM, "set P_Roll=1", "set roll_expo = 0", "save"))
    lines = with_gains(text, GAINS).lines
    assert lines[:3] == (ARM, "set p_roll = 20", "set roll_expo = 0")
    assert lines[-1] == "save"
    assert lines.count("set p_roll = 20") == 1
    assert with_gains(Text("x", lines), GAINS).lines == lines


@pytest.mark.parametrize("lines", [(), ("profile 1", "set p_roll = 7", "profile 0")])
def test_the_firmware_reads_the_gains_of_a_text(built, lines):
    found = bench("swift", with_gains(Text("x", (ARM, *lines)), GAINS))
    assert found.gains == GAINS
    assert gains_of(found.built.program, found.configuration) == GAINS


def test_other_gains_are_those_that_fly(built):
    found = bench("swift")
    same = found.response(0, found.gains)
    np.testing.assert_array_equal(same.rates, response("swift", 0).rates)
    assert np.abs(found.response(0, GAINS).rates - same.rates).max() > 0.01


def test_figures_of_a_response_are_those_of_its_formula():
    # 1 - exp(-t / tau): the rise takes tau ln 9, nothing overshoots, exp(-t / tau) is missing
    t = np.arange(1, 501) * DT
    found = StepResponse(2.0, 2.0 * (1.0 - np.exp(-t / 0.05)), np.full(10, 2.0), DT)
    assert found.rise_time == pytest.approx(0.05 * np.log(9.0), abs=2 * DT)
    assert found.overshoot == 0.0
    assert found.settled_error == pytest.approx(-np.exp(-0.425 / 0.05), rel=0.5)


@pytest.mark.parametrize("name", ["swift", "crazyflie"])
def test_the_wanted_response_falls_short_of_nothing(name):
    vehicle = load_vehicle(name)
    for axis in range(3):
        wanted = wanted_response(vehicle, axis, DT, PERIOD)
        worse = wanted._replace(rates=1.3 * wanted.rates)
        assert wanted.overshoot < 0.06
        assert shortfall(worse, wanted) > shortfall(wanted, wanted) + 0.1


def test_the_search_finds_gains_that_the_firmware_takes(built, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    # a search of seconds
    monkeypatch.setattr(gain_search, "TRIALS", 3)
    monkeypatch.setattr(gain_search, "P_GRID", (16,))
    monkeypatch.setattr(gain_search, "D_OF_P", (1.2,))
    monkeypatch.setattr(gain_search, "YAW_I", (2,))
    (tmp_path / "mine.txt").write_text(f"{ARM}\nset rc_smoothing = OFF\n")
    flags = ["--vehicle", "swift", "--betaflight", "mine.txt", "--out", "out.txt"]
    assert race(["firmware", "tune", *flags, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    lines = (tmp_path / "out.txt").read_text().splitlines()
    assert lines == found["lines"]
    tuned = bench("swift", read_text(tmp_path / "out.txt"))
    for name, gains in zip(AXIS_NAMES, tuned.gains, strict=True):
        after = found["axes"][name]["after"]
        assert gains == Gains(after["p"], after["i"], after["d"])
        assert after["overshoot"] <= found["axes"][name]["before"]["overshoot"]

    # It never writes over a file.
    assert race(["firmware", "tune", *flags]) == 2
    assert "--out: expected a new file, but out.txt exists" in capsys.readouterr().err


def refused(folder, monkeypatch, capsys, *flags):
    """Return the one line with which `race firmware tune` refuses its flags, without a search."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(gain_search, "search", pytest.fail)
    (folder / "wrong.txt").write_text("set nothing = 1\n")
    (folder / "no_arm.txt").write_text("set p_roll = 20\n")
    (folder / "nowhere").write_text("")
    assert race(["firmware", "tune", *flags]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    return err


@pytest.mark.parametrize(
    ("flags", "problem"),
    [
        (["--vehicle", "paper"], "--vehicle: expected a vehicle with rotors"),
        (["--vehicle", "none"], "none"),
        (["--betaflight", "none.txt"], "none.txt: expected a text"),
        (["--out", "nowhere/x.txt"], "nowhere: cannot write here"),
    ],
)
def test_bad_input_is_one_line_before_the_firmware_is_asked_for(
    absent, tmp_path, monkeypatch, capsys, flags, problem
):
    assert problem in refused(tmp_path, monkeypatch, capsys, *flags)


@pytest.mark.parametrize(
    ("file", "problem"),
    [
        ("wrong.txt", "wrong.txt:1: expected a line"),
        ("no_arm.txt", "no_arm.txt: expected a switch"),
    ],
)
def test_a_configuration_that_does_not_fly_is_one_line(
    built, tmp_path, monkeypatch, capsys, file, problem
):
    assert problem in refused(tmp_path, monkeypatch, capsys, "--betaflight", file)


@pytest.mark.parametrize("action", ["show", "build", "identify"])
def test_other_actions_write_no_configuration(capsys, action):
    assert race(["firmware", action, "--out", "x.txt"]) == 2
    assert f"--out: expected none beside {action}" in capsys.readouterr().err


def test_ctrl_c_is_one_line(built):
    command = "from quadsim.cli.cli import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", command, "firmware", "tune", "--vehicle", "swift"],
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    while process.poll() is None and not children.read_text():
        time.sleep(0.05)
    # A terminal sends it to the firmware too.
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert err == "race firmware: interrupted\n"
