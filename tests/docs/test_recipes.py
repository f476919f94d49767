"""The scripts of docs/recipes.md run as they stand, in an empty folder, with small planners."""

import re
from functools import partial

import pytest

import quadsim
from tests.docs.pages import ROOT, blocks

MOST_LINES = 20
SAMPLES = 128
# Heading of a task -> what an extra installs for it.
NEEDS = {"Train a pilot, and fly it": ("gymnasium", "stable_baselines3")}

SECTIONS = blocks(ROOT / "docs/recipes.md")
TASKS = {
    section[0].lines[0].removeprefix("## "): "\n".join(block.lines)
    for section in SECTIONS
    for block in section
    if block.kind == "python"
}
# What a script prints, beside a planner of any size.
PRINTS = {
    "Fly, and draw a figure of your own": r"split_s_swift: ",
    "Compare, down to a table": r"(?s)race_time.*colored +4\.0",
    "A sampler of your own, and a sweep over its parameter": r"16 knots",
    "A cost term with parameters of its own": r"weight 2: finished",
    "Dynamics of your own in a loop of your own": r"upright: 1\.0",
    "A vehicle of your own": r"ratio: 3\.6\n(?s:.*)1\.2 kg: finished",
    "Train a pilot, and fly it": r"gates passed",
    "A set of sensors of your own, and its consistency": r"NEES \d+\.\d",
    "Runs that were stored before": r"the same flight: True",
}

pytestmark = pytest.mark.flight


def small(function, *args, **settings):
    """Call quadsim.fly or quadsim.compare with few samples, unless a run is flown again."""
    if not (args and isinstance(args[0], dict)):
        settings["samples"] = SAMPLES
    return function(*args, **settings)


@pytest.mark.parametrize("task", TASKS)
def test_a_task_runs_and_prints_its_result(task, tmp_path, monkeypatch, capsys):
    for package in NEEDS.get(task, ()):
        pytest.importorskip(package)
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    if "quadsim.runs" in TASKS[task]:
        quadsim.fly("figure8", laps=1, samples=SAMPLES).save()
    monkeypatch.setattr(quadsim, "fly", partial(small, quadsim.fly))
    monkeypatch.setattr(quadsim, "compare", partial(small, quadsim.compare))
    exec(compile(TASKS[task], task, "exec"), {"__name__": "__main__"})
    printed = capsys.readouterr().out
    assert re.search(PRINTS[task], printed), printed


@pytest.mark.parametrize("task", TASKS)
def test_a_task_is_short(task):
    lines = [line for line in TASKS[task].splitlines() if line.strip()]
    assert len(lines) <= MOST_LINES
