"""The scripts of examples/ run as they stand, in an empty folder."""

import re
import runpy
from pathlib import Path

import matplotlib
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
# Modules that a script needs and no extra installs
NEEDS = {"train_with_stable_baselines": "stable_baselines3"}
# A pattern of the output of each; any other script prints that it finished
OUTCOMES = {
    "foreign_loop": r"6 s: 0\.0\d\d m from the goal",
    "own_term": r"square: 0\.[3-9]\d* rad/s\n.*square: 0\.[01]\d* rad/s",
    "own_system": r"angle from upright at the end: [0-5]\.\d deg",
    "sweep_gamma": r"gamma 4: lap \d+\.\d+ s",
    "two_samplers": r"colored - gaussian: [+-]\d+\.\d+ s a lap",
}


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_an_example_runs_and_prints_its_result(script, tmp_path, monkeypatch, capsys):
    if script.stem in NEEDS:
        pytest.importorskip(NEEDS[script.stem])
    matplotlib.use("agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.argv", [str(script)])
    runpy.run_path(str(script), run_name="__main__")
    printed = capsys.readouterr().out
    assert re.search(OUTCOMES.get(script.stem, r"finished"), printed), printed


def test_every_example_is_in_the_documentation():
    text = (EXAMPLES.parent / "docs" / "library.md").read_text(encoding="utf-8")
    assert SCRIPTS
    for script in SCRIPTS:
        assert f"`{script.name}`" in text
