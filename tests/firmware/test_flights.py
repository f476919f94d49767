"""Flights behind the firmware: the vehicle does what is commanded, and the same again."""

import re
from functools import partial

import numpy as np
import pytest

import quadsim
from quadsim.campaign.run.attempt import fly_attempt
from quadsim.cli.cli import race
from quadsim.config.build_plant import plant_of
from quadsim.config.spec import Spec
from quadsim.firmware.process import Firmware, FirmwareError
from quadsim.physics.plant import RigidPlant
from quadsim.record.archive import read_run
from quadsim.vehicle import GRAVITY, VEHICLES, load_vehicle
from tests.small import SHORT, flags

SWIFT = load_vehicle("swift")
CONFIGURATION = VEHICLES / "swift.betaflight.txt"
FLIGHT = {**SHORT, "flight_controller": "betaflight", "plant": "rigid"}


@pytest.fixture(scope="module")
def run(built):
    """Return a short flight."""
    return quadsim.fly("split_s_swift", **FLIGHT)


@pytest.fixture
def plant(built):
    """A vehicle that hovers behind the firmware."""
    made = plant_of(quadsim.Spec.of("split_s_swift", **FLIGHT))
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


def test_two_flights_are_the_same_to_the_last_bit(run):
    assert quadsim.fly("split_s_swift", **FLIGHT, threads=1).digest() == run.digest()
    assert quadsim.fly("split_s_swift", **FLIGHT, seed=1).digest() != run.digest()


def test_a_stored_flight_is_flown_again(built, run, tmp_path):
    loaded = read_run(run.save(tmp_path / "run"))
    assert loaded.digest() == run.digest()
    assert loaded.spec["betaflight"]["firmware"]["firmware"] == built.firmware
    again = quadsim.fly(Spec.of_record(loaded.spec))
    assert again.digest() == run.digest()


def test_a_configuration_of_ones_own_flies(built, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lines = "aux 0 0 0 1700 2100 0 0\nset p_roll = 30\n"
    (tmp_path / "mine.txt").write_text(lines)
    command = ["fly", "split_s_swift", *flags(FLIGHT)]
    assert race([*command, "--betaflight", "mine.txt"]) == 1
    (run,) = quadsim.runs(tmp_path / "runs")
    assert read_run(run.path).spec["betaflight"]["lines"] == lines.splitlines()
    (tmp_path / "mine.txt").write_text("set nothing = 1\n")
    capsys.readouterr()
    assert race([*command, "--betaflight", "mine.txt"]) == 2
    assert capsys.readouterr().err.startswith("race fly: mine.txt:1: expected a line of")


@pytest.mark.parametrize(
    ("settings", "name", "said"),
    [
        ({"flight_controller": "px4"}, "flight_controller", "betaflight"),
        ({"vehicle": "paper"}, "flight_controller", "a vehicle with rotors"),
        ({"vehicle": SWIFT.but(name="mine")}, "betaflight", "FILE.txt"),
        ({"vehicle": "none"}, None, "none"),
        ({"plant": "rotorpy"}, "flight_controller", "bullet or rigid"),
        ({"plant_dt": 0.00033, "dt": 0.0033}, "plant_dt", "5e-05 s"),
        ({"dt": 0.0105}, "dt", "a whole multiple"),
        ({"betaflight": "none.txt"}, None, "none.txt"),
        ({"betaflight": quadsim.load_vehicle}, "betaflight", "FILE.txt"),
        ({"flight_controller": "ideal", "betaflight": CONFIGURATION}, "betaflight", "none beside"),
        ({"blackbox": "none/flight.bbl"}, "blackbox", "a folder that exists"),
        ({"flight_controller": "ideal", "blackbox": "flight.bbl"}, "blackbox", "none without"),
        ({"link_hz": 5000}, "link_hz", "at most 1000 Hz"),
        ({"link_burst": 2}, "link_burst", "none without"),
        ({"view_weight": 1.0}, "view_weight", "a camera"),
        ({"pilot": "split_s_swift", "vehicle": "kingfisher"}, None, "kingfisher"),
        ({"preset": "race_informed", "displace_gates": 0.1}, "displace_gates", "0"),
        ({"laps": 0}, "laps", "0"),
    ],
)
def test_what_can_never_fly_is_one_line_before_the_firmware_is_asked_for(
    absent, settings, name, said
):
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        quadsim.Spec.of("split_s_swift", **FLIGHT | settings)
    assert "\n" not in str(caught.value)
    assert getattr(caught.value, "name", None) == name
    assert "not built" not in str(caught.value)


def test_without_the_firmware_the_command_that_builds_it_is_named(absent, tmp_path, capsys):
    command = ["fly", "split_s_swift", *flags(FLIGHT), "--runs-dir", str(tmp_path)]
    assert race(command) == 2
    err = capsys.readouterr().err
    assert err.endswith("which is not built yet: race firmware build\n")
    assert err.count("\n") == 1


def test_the_firmware_measures_with_the_noise_of_the_sensors(built):
    """Rates of a vehicle that hovers exactly are not exact behind a noisy gyroscope."""
    rates = {}
    for sensing in ("perfect", "gates"):
        made = plant_of(quadsim.Spec.of("split_s_swift", sensing=sensing, **FLIGHT))
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


def test_a_run_keeps_what_its_motors_did(run):
    variation = run.telemetry["motor_variation"]
    assert variation[0] == 0.0
    assert np.all(np.diff(variation) >= 0.0)
    flown = run.telemetry["t"][-1]
    assert run.metrics.motor_variation == pytest.approx(variation[-1] / flown)
    assert run.metrics.thrust_lost == pytest.approx(run.telemetry["thrust_lost"][-1] / flown)
    ideal = quadsim.fly("split_s_swift", **FLIGHT | {"flight_controller": "ideal"})
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
    fly = partial(quadsim.compare, "split_s_swift", {"firmware": FLIGHT}, attempts=4, randomize=1)

    def digests(comparison):
        return [quadsim.load_run(attempt.folder).digest() for attempt in comparison.attempts]

    found = digests(fly(jobs=2))
    assert found == digests(fly())
    assert len(set(found)) == 4


def test_a_firmware_that_ends_in_flight_is_no_crash_of_the_variant(built, monkeypatch):
    """A campaign would keep a crash, and never fly that attempt again."""
    step = Firmware.step

    def step_until_killed(firmware, *arguments, **keywords):
        if firmware.time > 6.8:
            firmware._process.kill()
            firmware._process.wait()
        return step(firmware, *arguments, **keywords)

    spec = quadsim.Spec.of("split_s_swift", **FLIGHT)
    monkeypatch.setattr(Firmware, "step", step_until_killed)
    with pytest.raises(FirmwareError, match=r"^firmware: its process ended after 6\.8\d* s"):
        fly_attempt(spec)


@pytest.fixture
def killed(built, monkeypatch):
    """Kill the firmware of each flight soon after its start."""
    quadsim.Spec.of("split_s_swift", **FLIGHT)  # the configuration has been read
    step = Firmware.step

    def step_until_killed(firmware, *arguments, **keywords):
        if firmware.time > 6.7:
            firmware._process.kill()
            firmware._process.wait()
        return step(firmware, *arguments, **keywords)

    monkeypatch.setattr(Firmware, "step", step_until_killed)


def test_a_flight_whose_firmware_is_killed_is_kept(built, killed, tmp_path, capsys):
    command = ["fly", "split_s_swift", *flags(FLIGHT), "--runs-dir", str(tmp_path)]
    assert race(command) == 2
    err = capsys.readouterr().err
    assert err.startswith("race fly: firmware: its process ended after 6.7")
    assert err.endswith("the flight so far is kept\n")
    (run,) = quadsim.runs(tmp_path)
    loaded = read_run(run.path)
    assert loaded.outcome == "interrupted"
    assert loaded.telemetry["t"][-1] == pytest.approx(0.1, abs=0.05)


OLD_TEXT = "# Betaflight / STM32F405 (S405) 4.5.1 Mar 16 2025\ndefaults nosave\n{}\n"


def test_a_text_of_an_older_version_flies_and_says_so(built, tmp_path, capsys):
    lines = "aux 0 0 0 1700 2100 0 0\naux 1 1 1 900 1300 0 0\nset dshot_idle_value = 900"
    file = tmp_path / "old.txt"
    file.write_text(OLD_TEXT.format(lines))
    assert race(["firmware", "read", "--betaflight", str(file)]) == 0
    out = capsys.readouterr().out
    assert "old.txt, of Betaflight 4.5: 2 lines taken, 1 translated" in out
    assert "5: set dshot_idle_value = 900 -> set motor_idle = 900" in out
    assert "AUX1 1000 to 1900 us, AUX2 1700 to 1700 us" in out
    assert "limits of swift: thrust 0 to 40.23 m/s^2, body rates 10, 10, 6 rad/s" in out
    settings = {**FLIGHT, "betaflight": file, "runs_dir": tmp_path}
    assert race(["fly", "split_s_swift", *flags(settings)]) == 1
    err = capsys.readouterr().err
    assert err.startswith("old.txt, of Betaflight 4.5: 2 lines taken, 1 translated, ")
    assert f"race firmware read --betaflight {file}\n" in err
    (run,) = quadsim.runs(tmp_path)
    stored = read_run(run.path)
    assert Spec.of_record(stored.spec).betaflight.lines == tuple(file.read_text().splitlines())


def test_a_race_of_which_a_firmware_is_killed_is_kept(built, killed, tmp_path, capsys):
    entrants = ["--entrants", "colored", "colored", "--runs-dir", str(tmp_path)]
    assert race(["heat", "split_s_swift", *entrants, *flags(FLIGHT)]) == 2
    err = capsys.readouterr().err
    assert err.startswith("race heat: firmware: its process ended after 6.7")
    assert err.endswith("the race so far is kept\n")
    kept = [read_run(path.parent) for path in tmp_path.rglob("run.json")]
    assert [run.outcome for run in kept] == ["interrupted"] * 2
