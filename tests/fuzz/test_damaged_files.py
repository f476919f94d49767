"""Damaged files are refused in one line: a few cases of `make fuzz`, in the test's own process."""

import random
import shutil

import pytest

from quadsim.cli.cli import race
from quadsim.config.spec import Spec
from tests.fuzz.foreign import foreign
from tests.fuzz.harness import Case, Outcome, wrong
from tests.fuzz.runs import damage
from tests.fuzz.yamls import yamls
from tests.run_cases import save, snapshot, two_laps


def outcome_of(argv, capsys):
    """Return the outcome of a command that runs here."""
    code = race(list(argv))
    printed = capsys.readouterr()
    return Outcome(code, printed.out, printed.err)


def test_a_damaged_yaml_is_checked_without_a_traceback(tmp_path, monkeypatch, capsys):
    for number in range(20):
        folder = tmp_path / str(number)
        folder.mkdir()
        monkeypatch.chdir(folder)
        damaged = yamls(random.Random(number))
        damaged.prepare(folder)
        case = Case("yamls", damaged.label, ("check", "f.yaml"))
        outcome = outcome_of(case.argv, capsys)
        assert outcome.code in (0, 2), case.label
        assert wrong(case, outcome) == "", case.label


def test_a_damaged_course_of_another_simulator_is_converted_or_refused(
    tmp_path, monkeypatch, capsys
):
    for number in range(40):
        folder = tmp_path / str(number)
        folder.mkdir()
        monkeypatch.chdir(folder)
        case = foreign(random.Random(number))
        case.prepare(folder)
        outcome = outcome_of(case.argv, capsys)
        assert (wrong(case, outcome) or case.after(folder, outcome)) == "", case.label


@pytest.mark.slow
def test_a_damaged_run_is_refused_in_one_line(tmp_path, monkeypatch, capsys):
    stored = save(
        tmp_path / "stored", two_laps(Spec.of("paper_flat").record(), snapshot=snapshot())
    )
    for name in ("run.json", "telemetry.npz", "events.csv"):
        for number in range(5):
            folder = tmp_path / f"{name} {number}"
            run = folder / "runs" / stored.name
            shutil.copytree(stored, run)
            monkeypatch.chdir(folder)
            damage(random.Random(folder.name), run / name)
            outcome = outcome_of(("show",), capsys)
            assert wrong(Case("runs", "", ("show",)), outcome) == "", folder.name
