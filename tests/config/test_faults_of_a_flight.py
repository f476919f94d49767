"""Faults in a Spec: what is refused, what is recorded, and what they do to a flight."""

import json
from dataclasses import replace

import numpy as np
import pytest

import quadsim
from quadsim.cli.cli import race
from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
from quadsim.physics.faults import parse_fault
from tests.small import SHORT, flags

FLIGHT = {**SHORT, "first_iterations": 10}


def spec(**settings) -> Spec:
    return Spec.of(**FLIGHT | settings)


class Still:
    """A plant of a user's own, that is never stepped here."""

    dt = 1 / 400

    def step(self, u):
        """Refuse to be stepped."""
        raise AssertionError


@pytest.mark.parametrize(
    "settings",
    [
        {"fault": "rotor9=.5"},
        {"fault": ["commands=lost", "camera=blind"]},
        {"fault": "rotor1=.5", "vehicle": "paper"},
        {"fault": "mass=1.1", "vehicle": "paper"},
        {"fault": "rotor1=.5", "plant": "rotorpy"},
        {"fault": "rate_gain=.8", "flight_controller": "betaflight"},
        {"fault": "rotor1=.5", "plant": Still()},
        {"fault": "gyro=frozen"},
        {"fault": "pose=lost", "sensing": "gates"},
        {"fault": "rotors=lost", "sensing": "gates"},
        {"fault": 3},
    ],
)
def test_a_fault_of_a_part_that_is_not_there_is_refused_in_one_line(settings):
    with pytest.raises(SettingError) as error:
        spec(**settings)
    assert error.value.name == "fault"
    assert "\n" not in str(error.value)


def test_commands_can_be_lost_on_the_way_to_any_plant():
    for settings in ({"plant": "rigid"}, {"plant": Still()}, {"vehicle": "paper"}):
        assert spec(fault="commands=lost", **settings).drawn_faults


def test_a_record_has_the_faults_as_given_and_as_drawn():
    assert (spec().record()["fault"], spec().record()["drawn_faults"]) == ([], [])
    record = json.loads(json.dumps(spec(fault=["rotor=.5", "commands=lost@1~.5"]).record()))
    assert record["fault"] == ["rotor=.5", "commands=lost@1~.5"]
    rotor, commands = map(parse_fault, record["drawn_faults"])
    assert str(commands) == "commands=lost@1-1.5"
    assert None not in (rotor.rotor, rotor.window.start)


def test_each_seed_draws_its_own_faults_and_the_same_again():
    one = spec(fault="rotor=.5", seed=3)
    assert one.drawn_faults == spec(fault="rotor=.5", seed=3).drawn_faults
    assert one.drawn_faults != one.but(seed=4).drawn_faults
    assert one.but(seed=4).drawn_faults == replace(one, seed=4).drawn_faults


def telemetry(**settings):
    run = quadsim.fly(spec(**settings))
    columns = {name: run.telemetry[name] for name in run.telemetry if not name.endswith("_ms")}
    return run, columns


@pytest.mark.compiled
def test_a_flight_is_the_same_to_the_last_bit_until_its_fault():
    _, sound = telemetry(sensing="mocap")
    for fault in ("rotor2=.2@.2", "commands=lost@.2", "gyro=1:0:0@.2", "pose=lost@.2"):
        _, faulty = telemetry(sensing="mocap", fault=fault)
        before = sound["t"] < 0.2 - 1e-9
        for name, column in sound.items():
            np.testing.assert_array_equal(faulty[name][: len(before)][before], column[before])
        assert any((faulty[n][-5:] != sound[n][-5:]).any() for n in sound), fault


@pytest.mark.compiled
def test_what_the_seed_drew_can_be_flown_again_as_a_text():
    run, drawn = telemetry(fault="rotor=.2@.1", seed=3)
    (text,) = run.spec["drawn_faults"]
    _, given = telemetry(fault=text, seed=3)
    for name, column in drawn.items():
        np.testing.assert_array_equal(given[name], column)


@pytest.mark.compiled
def test_a_recorded_flight_with_drawn_faults_is_flown_again_by_its_record():
    flown = spec(fault=["rotor=.2@.1", "commands=lost~.1"], seed=3)
    run = quadsim.fly(flown)
    again = Spec.of_record(run.spec)
    assert again.drawn_faults == flown.drawn_faults
    assert quadsim.fly(again).digest() == run.digest()


@pytest.mark.compiled
def test_commands_are_recorded_as_they_were_sent_and_act_as_they_arrived():
    """The controller is not told: its record has commands that the vehicle never got."""
    run, columns = telemetry(fault="commands=lost@0", plant="rigid", vehicle="paper")
    assert run.spec["drawn_faults"] == ["commands=lost@0"]
    assert np.ptp(columns["a_cmd"]) > 1.0
    np.testing.assert_allclose(columns["a"], 9.81, atol=1e-9)


@pytest.mark.compiled
def test_report_and_show_name_the_faults(tmp_path, capsys):
    faults = ["--fault", "rotor2=.5@.1", "--fault", "commands=lost@.2~.1"]
    folder = ["--runs-dir", str(tmp_path)]
    race(["fly", *faults, *flags(FLIGHT), *folder])
    flown = capsys.readouterr().out
    race(["show", *folder])
    shown = capsys.readouterr().out
    race(["show", "--json", *folder])
    record = json.loads(capsys.readouterr().out)
    for text in ("rotor2=0.5@0.1", "commands=lost@0.2-0.3"):
        assert text in " ".join(flown.split())
        assert text in " ".join(shown.split())
    assert record["faults"] == ["rotor2=0.5@0.1", "commands=lost@0.2-0.3"]
