"""Damaged files are refused in one line: a few cases of `make fuzz`, in the test's own process."""

import random
import shutil

import pytest

import quadsim
from quadsim.cli.cli import race
from tests.fuzz.harness import Case, Outcome, wrong
from tests.fuzz.runs import damage
from tests.fuzz.yamls import yamls

SMALL = {"samples": 128, "horizon": 20, "iterations": 1, "timeout": 0.1}


def outcome_of(argv, capsys):
    """Return the outcome of a command that runs here."""
    code = race(list(argv))
    printed = capsys.readouterr()
    return Outcome(code, printed.out, printed.err)


@pytest.mark.parametrize("number", range(20))
def test_a_damaged_yaml_is_checked_without_a_traceback(number, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    damaged = yamls(random.Random(number))
    damaged.prepare(tmp_path)
    case = Case("yamls", damaged.label, ("check", "f.yaml"))
    outcome = outcome_of(case.argv, capsys)
    assert outcome.code in (0, 2)
    assert wrong(case, outcome) == "", case.label


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """Return the folder of a stored run."""
    run = quadsim.fly("paper_flat", preset="paper", **SMALL)
    return quadsim.save_run(run, tmp_path_factory.mktemp("runs"))


@pytest.mark.parametrize("name", ["run.json", "telemetry.npz", "events.csv"])
@pytest.mark.parametrize("number", range(5))
def test_a_damaged_run_is_refused_in_one_line(name, number, stored, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run = tmp_path / "runs" / stored.name
    shutil.copytree(stored, run)
    damage(random.Random(f"{name} {number}"), run / name)
    outcome = outcome_of(("show",), capsys)
    assert wrong(Case("runs", "", ("show",)), outcome) == "", outcome
