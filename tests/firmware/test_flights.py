"""Flights behind the firmware: the vehicle does what is commanded, and the same again."""

from functools import partial

import numpy as np
import pytest

import quadsim
from quadsim.campaign.attempt import fly_attempt
from quadsim.cli.cli import race
from quadsim.files.values import SettingError
from quadsim.firmware import package
from quadsim.firmware.process import Firmware, FirmwareError
from quadsim.physics.plant import RigidPlant
from quadsim.record.archive import load_run
from quadsim.spec.build import plant_of
from quadsim.spec.identified import identified
from quadsim.spec.recorded import spec_of_record
from quadsim.vehicle import GRAVITY

SHORT = {
    "flight_controller": "betaflight",
    "plant": "rigid",
    "samples": 64,
    "horizon": 20,
    "timeout": 0.5,
}


@pytest.fixture
def plant(built):
    """A vehicle that hovers behind the firmware."""
    made = plant_of(quadsim.Spec.of("split_s_swift", **SHORT))
    assert isinstance(made, RigidPlant)
    yield made
    made.close()


def fly_steps(plant, command, seconds):
    """Hold a command, and return the states."""
    return [plant.step(command).x for _ in range(round(seconds / plant.dt))]


def test_the_vehicle_hovers_before_anything_is_commanded(plant):
    states = fly_steps(plant, (0.0, 0.0, 0.0, GRAVITY), 0.3)
    thrusts = [x.thrust for x in states]
    np.testing.assert_allclose(thrusts, GRAVITY, rtol=0.02)
    assert np.abs([x.body_rates for x in states]).max() < 1e-3


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_vehicle_turns_as_it_is_commanded(plant, axis, sign):
    command = [0.0, 0.0, 0.0, 12.0]
    command[axis] = 2.0 * sign
    rates = np.array([x.body_rates for x in fly_steps(plant, command, 0.6)])
    others = [other for other in range(3) if other != axis]
    assert rates[-100:, axis].mean() == pytest.approx(2.0 * sign, rel=0.1)
    assert np.abs(rates[-100:, others]).max() < 0.2


def test_the_thrust_is_the_one_that_is_commanded(plant):
    states = fly_steps(plant, (0.0, 0.0, 0.0, 25.0), 0.4)
    assert states[-1].thrust == pytest.approx(25.0, rel=0.02)


def test_two_flights_are_the_same_to_the_last_bit(built):
    first = quadsim.fly("split_s_swift", **SHORT)
    assert quadsim.fly("split_s_swift", **SHORT, threads=1).digest() == first.digest()
    assert quadsim.fly("split_s_swift", **SHORT, seed=1).digest() != first.digest()


def test_a_stored_flight_is_flown_again(built, tmp_path):
    run = quadsim.fly("split_s_swift", **SHORT)
    loaded = load_run(run.save(tmp_path / "run"))
    assert loaded.spec["betaflight"]["firmware"]["firmware"] == built.firmware
    again = quadsim.fly(spec_of_record(loaded.spec))
    assert again.digest() == run.digest()


def test_a_configuration_of_ones_own_flies(built, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lines = "aux 0 0 0 1700 2100 0 0\nset p_roll = 30\n"
    (tmp_path / "mine.txt").write_text(lines)
    flags = ["--plant", "rigid", "--samples", "64", "--horizon", "20", "--timeout", "0.2"]
    command = ["fly", "split_s_swift", "--flight-controller", "betaflight", *flags]
    assert race([*command, "--betaflight", "mine.txt"]) == 1
    (run,) = quadsim.runs(tmp_path / "runs")
    assert load_run(run.path).spec["betaflight"]["lines"] == lines.splitlines()
    (tmp_path / "mine.txt").write_text("set nothing = 1\n")
    capsys.readouterr()
    assert race([*command, "--betaflight", "mine.txt"]) == 2
    assert capsys.readouterr().err.startswith("race fly: mine.txt:1: expected a line of")


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"vehicle": "paper"}, "flight_controller: expected a vehicle with rotors"),
        ({"plant": "rotorpy"}, "flight_controller: expected plant bullet or rigid"),
        ({"plant_dt": 0.00033, "dt": 0.0033}, "plant_dt: expected a whole multiple of 5e-05 s"),
        (
            {"vehicle": quadsim.load_vehicle("swift").but(name="mine")},
            "betaflight: expected FILE.txt of Betaflight's CLI for the v",
        ),
        ({"flight_controller": "px4"}, "flight_controller: "),
        ({"vehicle": "swift", "betaflight": "none.txt"}, r"none\.txt: expected a text"),
        (
            {"flight_controller": "ideal", "betaflight": quadsim.load_vehicle},
            "betaflight: expected a FILE.txt",
        ),
    ],
)
def test_what_does_not_fit_the_firmware_is_one_line(settings, problem):
    with pytest.raises((SettingError, ValueError), match=problem) as caught:
        quadsim.Spec.of("split_s_swift", **SHORT | settings)
    assert "\n" not in str(caught.value)


def test_without_the_firmware_the_command_that_builds_it_is_named(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    package.built_firmware.cache_clear()
    # An earlier flight of this process may have been identified.
    identified.cache_clear()
    flags = ["--plant", "rigid", "--flight-controller", "betaflight"]
    assert race(["fly", *flags, "--runs-dir", str(tmp_path)]) == 2
    err = capsys.readouterr().err
    package.built_firmware.cache_clear()
    assert err.endswith("which is not built yet: race firmware build\n")
    assert err.count("\n") == 1


def test_the_firmware_measures_with_the_noise_of_the_sensors(built):
    """Rates of a vehicle that hovers exactly are not exact behind a noisy gyroscope."""
    rates = {}
    for sensing in ("perfect", "gates"):
        made = plant_of(quadsim.Spec.of("split_s_swift", sensing=sensing, **SHORT))
        states = fly_steps(made, (0.0, 0.0, 0.0, GRAVITY), 0.3)
        made.close()
        rates[sensing] = np.std([x.body_rates for x in states])
    assert rates["perfect"] < 1e-3 < rates["gates"]


def test_steady_motors_do_not_vary_and_lose_no_thrust(plant):
    hover = (0.0, 0.0, 0.0, GRAVITY)
    fly_steps(plant, hover, 0.5)
    before = plant.state.motors
    fly_steps(plant, hover, 0.5)
    after = plant.state.motors
    assert after.motor_variation - before.motor_variation < 0.01
    assert after.thrust_lost == before.thrust_lost == 0.0


def test_motors_vary_with_commands_that_chatter(plant):
    rolled = []
    for size in (1.0, 2.0):
        before = plant.state.motors.motor_variation
        for k in range(40):
            roll = size if k % 2 else -size
            fly_steps(plant, (roll, 0.0, 0.0, 15.0), 0.01)
        rolled.append(plant.state.motors.motor_variation - before)
    assert rolled[1] > 1.5 * rolled[0] > 0.0


def test_turning_at_full_thrust_costs_thrust(plant):
    full = quadsim.Spec.of("split_s_swift").vehicle.thrust_max
    straight = fly_steps(plant, (0.0, 0.0, 0.0, full), 0.4)
    assert plant.state.motors.thrust_lost == pytest.approx(0.0, abs=0.01)
    fly_steps(plant, (8.0, 0.0, 0.0, full), 0.1)
    lost = plant.state.motors.thrust_lost
    assert lost > 0.1  # [m/s]
    assert straight[-1].thrust == pytest.approx(full, rel=0.02)


def test_a_run_keeps_what_its_motors_did(built, tmp_path):
    run = quadsim.fly("split_s_swift", **SHORT)
    variation = run.telemetry["motor_variation"]
    assert variation[0] == 0.0
    assert np.all(np.diff(variation) >= 0.0)
    flown = run.telemetry["t"][-1]
    assert run.metrics.motor_variation == pytest.approx(variation[-1] / flown)
    assert run.metrics.thrust_lost == pytest.approx(run.telemetry["thrust_lost"][-1] / flown)
    assert load_run(run.save(tmp_path / "run")).digest() == run.digest()
    ideal = quadsim.fly("split_s_swift", **SHORT | {"flight_controller": "ideal"})
    assert "motor_variation" not in ideal.telemetry
    assert ideal.metrics.motor_variation is ideal.metrics.thrust_lost is None


def test_the_plan_is_smoothed_behind_the_firmware_unless_one_says_no(built):
    assert not quadsim.Spec.of("split_s_swift").planner.mppi.smooth
    behind = quadsim.Spec.of("split_s_swift", flight_controller="betaflight")
    assert behind.planner.mppi.smooth
    assert not behind.but(flight_controller="ideal").planner.mppi.smooth
    assert not behind.but(smooth=False).planner.mppi.smooth


@pytest.mark.parametrize(
    ("text", "smooth"), [("base: race\n", True), ("base: race\nmppi: {smooth: false}\n", False)]
)
def test_a_preset_file_is_as_its_base_behind_the_firmware(built, tmp_path, text, smooth):
    (tmp_path / "mine.yaml").write_text(text)
    spec = quadsim.Spec.of(
        "split_s_swift", preset=tmp_path / "mine.yaml", flight_controller="betaflight"
    )
    assert spec.planner.mppi.smooth is smooth


def test_a_campaign_in_parallel_equals_the_same_in_sequence(built):
    fly = partial(quadsim.compare, "split_s_swift", {"firmware": SHORT}, attempts=8, randomize=1)

    def digests(comparison):
        return [quadsim.load_run(attempt.folder).digest() for attempt in comparison.attempts]

    found = digests(fly(jobs=2))
    assert found == digests(fly())
    assert len(set(found)) == 8


def test_a_firmware_that_ends_in_flight_is_no_crash_of_the_variant(built, monkeypatch):
    """A campaign would keep a crash, and never fly that attempt again."""
    step = Firmware.step

    def step_until_killed(firmware, *arguments, **keywords):
        if firmware.time > 7.0:
            firmware._process.kill()
            firmware._process.wait()
        return step(firmware, *arguments, **keywords)

    spec = quadsim.Spec.of("split_s_swift", **SHORT)
    monkeypatch.setattr(Firmware, "step", step_until_killed)
    with pytest.raises(FirmwareError, match=r"^firmware: its process ended after 7\.\d+ s"):
        fly_attempt(spec)
