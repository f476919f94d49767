"""The scripts of examples/ run as they stand, in an empty folder, with a small planner."""

import re
import runpy
from functools import partial
from pathlib import Path

import pytest

import quadsim

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
# Packages that no extra installs.
NEEDS = {"train_with_stable_baselines": "stable_baselines3"}
# Patterns of what scripts print; any other script prints that its flight finished.
OUTCOMES = {
    "foreign_loop": r"6 s: 0\.0\d\d m from the goal",
    "own_term": r"square: 0\.[3-9]\d* rad/s\n.*square: 0\.[0-2]\d* rad/s",
    "own_system": r"angle from upright at the end: [0-5]\.\d deg",
    "sweep_gamma": r"gamma 4: lap \d+\.\d+ s",
    "two_samplers": r"colored - gaussian: [+-]\d+\.\d+ s a lap",
}
# The examples show how something is written, not how fast it flies.
SAMPLES = 128
ATTEMPTS = 2

pytestmark = pytest.mark.flight


def small(function, *args, **settings):
    """Call quadsim.fly or quadsim.compare with few samples and attempts."""
    if "system" not in settings:
        settings["samples"] = SAMPLES
    if "attempts" in settings:
        settings["attempts"] = ATTEMPTS
    return function(*args, **settings)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_an_example_runs_and_prints_its_result(script, tmp_path, monkeypatch, capsys):
    if script.stem in NEEDS:
        pytest.importorskip(NEEDS[script.stem])
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(quadsim, "fly", partial(small, quadsim.fly))
    monkeypatch.setattr(quadsim, "compare", partial(small, quadsim.compare))
    runpy.run_path(str(script), run_name="__main__")
    printed = capsys.readouterr().out
    assert re.search(OUTCOMES.get(script.stem, r"finished"), printed), printed
