"""`race fit`: what it reads, writes and refuses. What is fitted is tested with quadsim.identify."""

import json
from pathlib import Path

import numpy as np
import pytest

from quadsim import api
from quadsim.cli.cli import race
from quadsim.files.values import SettingError
from quadsim.identify import FittedNumber, VehicleFit
from quadsim.identify.prediction import Prediction
from quadsim.vehicle import load_vehicle
from tests.logs.log_cases import nanobench_columns, write_csv

NUMBERS = (
    FittedNumber("mass", "kg", 0.04, 0.04, 0.04, "given"),
    FittedNumber("drag.x", "1/s", 0.3, 0.25, 0.35, "log"),
    FittedNumber("rotors.motor_tau", "s", 0.04, 0.04, 0.04, "prior"),
)
PREDICTION = Prediction("three.csv", 0.5, 30, 0.041, None, 0.166, None, None)
REMARK = "inertia_z: the flights excite it too little"


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Return what the command asks the fit for; the fit returns these numbers."""
    monkeypatch.chdir(tmp_path)
    calls = []

    def fit_vehicle(logs, **settings):
        calls.append({"logs": [log.name for log in logs], **settings})
        vehicle = load_vehicle("crazyflie").but(name=settings["name"], mass=0.04)
        return VehicleFit(
            name=settings["name"],
            vehicle=vehicle,
            numbers=NUMBERS,
            remarks=(REMARK,),
            predictions=(PREDICTION,),
            traces=(),
            residuals={"force": np.array([0.3, -0.4, 0.1])},
        )

    monkeypatch.setattr("quadsim.identify.fit_vehicle", fit_vehicle)
    for name in ("one.csv", "two.csv", "three.csv"):
        write_csv(tmp_path / name, nanobench_columns())
    return calls


@pytest.mark.slow
def test_it_reads_the_logs_and_writes_a_vehicle_that_flies(asked, capsys):
    words = ["one.csv", "two.csv", "--test", "three.csv", "--mass", ".04", "--name", "mine"]
    assert race(["fit", *words, "--like", "crazyflie"]) == 0
    (call,) = asked
    assert call["logs"] == ["one.csv", "two.csv"]
    assert [log.name for log in call["test"]] == ["three.csv"]
    assert (call["mass"], call["base"].name) == (0.04, "crazyflie")
    assert load_vehicle("mine.yaml").mass == 0.04
    assert Path("mine.png").read_bytes().startswith(b"\x89PNG")
    out, err = capsys.readouterr()
    assert "drag.x" in out
    assert "0.25" in out
    assert out.splitlines()[-4].split() == ["three.csv", "0.5", "0.041", "0.166"]
    assert err.splitlines() == [REMARK]


@pytest.mark.slow
def test_json_has_the_numbers_and_the_remarks(asked, capsys):
    assert race(["fit", "one.csv", "--mass", ".04", "--name", "mine", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["file"], found["picture"]) == ("mine.yaml", "mine.png")
    assert found["numbers"][1] == NUMBERS[1]._asdict()
    assert found["remarks"] == [REMARK]


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (["--name", "mine"], "expected one LOG or more"),
        (["none.csv", "--name", "mine"], "none.csv: expected a log, got no such file"),
        (["nothing", "--name", "mine"], "no runs in 'runs'"),
        (["one.csv", "--name", "a/b"], "--name: expected letters"),
        (["one.csv", "--name", "mine", "--out", "mine.txt"], "--out: expected FILE.yaml"),
        (["one.csv", "--name", "there"], "'there.yaml': expected the name of a new file"),
        (["one.csv", "--name", "mine", "--like", "swfit"], "no vehicle 'swfit'"),
        (["one.csv", "--name", "mine", "--mapping", "none"], "no mapping 'none'"),
    ],
)
def test_what_it_cannot_do_is_one_line_and_writes_nothing(asked, tmp_path, capsys, words, problem):
    (tmp_path / "there.yaml").write_text("")
    assert race(["fit", *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"race fit: {problem}")
    assert asked == []
    assert not (tmp_path / "mine.yaml").exists()


def test_what_the_logs_lack_is_said_of_the_logs_and_of_no_flag(asked, monkeypatch, capsys):
    def too_short(logs, **settings):
        raise SettingError("logs", "expected at least 5 s of flight, got 2 s")

    monkeypatch.setattr("quadsim.identify.fit_vehicle", too_short)
    assert race(["fit", "one.csv", "--mass", ".04", "--name", "mine"]) == 2
    said = "race fit: one.csv: expected at least 5 s of flight, got 2 s\n"
    assert capsys.readouterr().err == said


def test_the_planners_model_has_lags_that_a_vehicle_file_lacks():
    lags = [FittedNumber(f"rate_lag.{axis}", "s", 0.07, 0.06, 0.08, "log") for axis in "xyz"]
    vehicle = load_vehicle("crazyflie")
    for numbers, rate_lag in ((lags, (0.07, 0.07, 0.07)), ([], None)):
        found = VehicleFit("mine", vehicle, (*NUMBERS, *numbers), (), ())
        assert found.model.rate_lag == rate_lag
        assert found.model.motor_tau == vehicle.rotors.motor_tau


def test_logs_are_given_as_paths_and_as_they_were_read(asked):
    (log,) = api.read_logs("one.csv")
    api.fit(log, mass=0.04)
    api.fit([log, "two.csv"], test="three.csv", mass=0.04)
    one, both = asked
    assert one["logs"] == ["one.csv"]
    assert both["logs"] == ["one.csv", "two.csv"]
    assert np.isfinite(both["test"][0].position).all()
