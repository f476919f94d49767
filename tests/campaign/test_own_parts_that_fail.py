"""A part of the user's own that fails costs its own attempts, and says which they are."""

import re
import sys
from pathlib import Path

import pytest

import quadsim
from quadsim.campaign.flights.baseline import fly_baselines
from quadsim.campaign.run.pool import Pool
from quadsim.campaign.run.variants import Variant, expect_importable
from quadsim.cli.cli import race
from quadsim.cli.report import summary
from quadsim.config.spec import Spec
from quadsim.files.values import SettingError
from quadsim.record.run import RunError

FILE = Path(__file__).name


class Level:
    """A controller that holds the attitude, until it fails."""

    def __init__(self, fails_at=None):
        self.calls = 0
        self.fails_at = fails_at

    def control(self, x):
        self.calls += 1
        if self.calls == self.fails_at:
            raise ZeroDivisionError("division by zero")
        return (0.0, 0.0, 0.0, 9.81)


def compared(**controllers):
    variants = {name: {"controller": controller} for name, controller in controllers.items()}
    return quadsim.compare("figure8", variants, attempts=2, laps=1, timeout=0.2)


def test_an_attempt_whose_controller_raises_is_a_row_and_the_others_go_on():
    found = compared(fails=Level(fails_at=5), level=Level())
    outcomes = [(attempt.variant, attempt.outcome) for attempt in found.attempts]
    assert outcomes == [("fails", "error")] * 2 + [("level", "timeout")] * 2
    (fault,) = {attempt.fault for attempt in found.attempts} - {None}
    assert re.fullmatch(rf"ZeroDivisionError: division by zero \({FILE}, line \d+\)", fault)


def test_the_error_of_a_controller_is_in_the_tables_in_json_and_in_the_stored_run(capsys):
    found = compared(fails=Level(fails_at=5), level=Level())
    fault = found.attempts[0].fault
    fails, level = found.as_json()["variants"]
    assert fails["faults"] == {fault: [0, 1]}
    assert (fails["finished"], fails["attempts"], fails["crashes"]) == (0, 2, {"error": 2})
    assert level["faults"] == {}
    shown = " ".join(str(found).split())
    assert f"Ended by an error: fails, seeds 0, 1: {fault}" in shown
    assert "2 error" in shown
    assert capsys.readouterr().err.count(fault) == 1  # once for both seeds
    run = quadsim.load_run(found.attempts[0].folder)
    assert (run.outcome, run.fault) == ("error", fault)
    ended = f"an error of your own code ended it: {fault}"
    assert ended in run.report()
    assert ended in str(run)
    assert summary(run, None)["fault"] == fault


class Reader:
    """A controller that reads a file, which is no part of its identity."""

    def __init__(self, file):
        self.file = file
        self.calls = 0

    def control(self, x):
        self.calls += 1
        text = self.file.read_text() if self.calls > 3 else "9.81"
        return (0.0, 0.0, 0.0, float(text))


def test_attempts_that_an_error_of_own_code_ended_are_flown_again(tmp_path, capsys):
    number = tmp_path / "thrust.txt"
    campaign = tmp_path / "c.sqlite"

    def flown():
        settings = {"attempts": 2, "laps": 1, "timeout": 0.2, "campaign": campaign}
        found = quadsim.compare("figure8", {"reads": {"controller": Reader(number)}}, **settings)
        return [attempt.outcome for attempt in found.attempts]

    number.write_text("much")
    assert flown() == ["error"] * 2
    capsys.readouterr()
    assert race(["results", "--campaigns", str(campaign)]) == 0
    assert "Ended by an error: reads, seeds 0, 1: ValueError: " in capsys.readouterr().out
    number.write_text("9.81")
    assert flown() == ["timeout"] * 2
    said = "2 attempts ended in an error of your own code and are flown again"
    assert said in capsys.readouterr().err
    assert len(list((tmp_path / "c.flights").iterdir())) == 2  # those of the errors are removed
    assert flown() == ["timeout"] * 2
    assert capsys.readouterr().err == ""  # both are kept


def test_races_that_an_error_of_own_code_ended_are_flown_again(tmp_path, capsys):
    number = tmp_path / "thrust.txt"
    entrants = {"reads": {"controller": Reader(number)}, "level": {"controller": Level()}}

    def flown():
        small = {"laps": 1, "timeout": 0.2, "starts": 2, "campaign": tmp_path / "heats.sqlite"}
        found = quadsim.compare_heats(entrants, "figure8", **small)
        return found.settings[0].summary.faults

    number.write_text("much")
    (fault,) = set(flown()["reads"])
    assert re.fullmatch(rf"ValueError: could not .* 'much' \({FILE}, line \d+\)", fault)
    number.write_text("9.81")
    capsys.readouterr()
    assert flown() == {}
    said = "2 races ended in an error of your own code and are flown again"
    assert said in capsys.readouterr().err


def test_a_baseline_flown_with_a_controller_that_raises_has_no_verdict():
    spec = Spec.of("figure8", controller=Level(fails_at=5), laps=1, timeout=0.2)
    with pytest.raises(RunError, match=r"mine seed 0: an error of your own code .*ZeroDivision"):
        fly_baselines(Pool(), [Variant("mine", spec)], [2])


def test_a_controller_that_raises_at_once_is_one_line_with_the_seed():
    with pytest.raises(RunError, match="seed 0: ZeroDivisionError: division by zero"):
        compared(fails=Level(fails_at=1))


def test_a_part_of_a_notebook_is_refused_where_workers_fly(monkeypatch):
    spec = Spec.of("figure8", controller=Level())
    monkeypatch.setattr(sys.modules["__main__"], "__file__", "script.py", raising=False)
    monkeypatch.setattr(Level, "__module__", "__main__")
    expect_importable(spec)  # a script: workers read it again
    monkeypatch.delattr(sys.modules["__main__"], "__file__")
    with pytest.raises(SettingError, match="expected a controller that workers can import"):
        expect_importable(spec)
