"""The scripts of examples/ run as they stand, in an empty folder."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
SCRIPTS = sorted(EXAMPLES.glob("*.py"))
LONGEST = 80  # lines
NEEDS = {"train_with_stable_baselines": "stable_baselines3"}  # what no extra installs
OUTCOMES = {  # a pattern of what each prints; of any other script: that it finished
    "foreign_loop": r"6 s: 0\.0\d\d m from the goal",
    "own_term": r"square: 0\.[3-9]\d* rad/s\n.*square: 0\.[01]\d* rad/s",
    "own_system": r"angle from upright at the end: [0-5]\.\d deg",
    "sweep_gamma": r"gamma 4: lap \d+\.\d+ s",
    "two_samplers": r"colored - gaussian: [+-]\d+\.\d+ s a lap",
}


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_an_example_runs_and_prints_its_result(script, tmp_path):
    if script.stem in NEEDS:
        pytest.importorskip(NEEDS[script.stem])
    paths = os.pathsep.join([str(EXAMPLES.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | {"PYTHONPATH": paths, "MPLBACKEND": "agg"}
    done = subprocess.run(
        [sys.executable, script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    assert re.search(OUTCOMES.get(script.stem, r"finished"), done.stdout), done.stdout


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_an_example_says_what_it_shows_and_is_short(script):
    text = script.read_text(encoding="utf-8")
    assert ast.get_docstring(ast.parse(text))
    assert len(text.splitlines()) <= LONGEST


def test_every_example_is_in_the_documentation():
    listed = (EXAMPLES.parent / "docs" / "library.md").read_text(encoding="utf-8")
    assert SCRIPTS
    assert [script.name for script in SCRIPTS if f"`{script.name}`" not in listed] == []
