"""The scripts and notebooks of examples/, and the recipes of docs/recipes.md, run.

In `make test` they fly a short course with a small planner, and every flight has to finish. In
`make docs-check` they fly their own courses with few samples, and what they print is read;
tests/test_notebooks.py does that for the notebooks. Those that need stable-baselines3 run in
`make regression`.
"""

import json
import re
import runpy
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

import quadsim
from quadsim.config.build_cost import check_cost, cost_on
from tests.docs.pages import ROOT, blocks
from tests.small import SMALL

SCRIPTS = {path.stem: path for path in sorted((ROOT / "examples").glob("*.py"))}
RECIPES = {
    section[0].lines[0].removeprefix("## "): "\n".join(block.lines)
    for section in blocks(ROOT / "docs/recipes.md")
    for block in section
    if block.kind == "python"
}
NOTEBOOKS = {
    path.name: "\n".join(
        "".join(cell["source"])
        for cell in json.loads(path.read_text())["cells"]
        if cell["cell_type"] == "code"
    )
    for path in sorted((ROOT / "examples/notebooks").glob("*.ipynb"))
}
# What they print beside a planner of any size; any other script prints that its flight finished.
PRINT = {
    "foreign_loop": r"6 s: 0\.0\d\d m from the goal",
    "own_term": r"square: (0\.[3-9]|1\.)\d* rad/s\n.*square: 0\.[0-2]\d* rad/s",
    "own_system": r"angle from upright at the end: [0-5]\.\d deg",
    "sweep_gamma": r"gamma 4: lap \d+\.\d+ s",
    "two_samplers": r"colored - gaussian: [+-]\d+\.\d+ s a lap",
    "Fly, and draw a figure of your own": r"split_s_swift: ",
    "Compare, down to a table": r"(?s)race_time.*colored +1\.0",
    "A sampler of your own, and a sweep over its parameter": r"8 knots",
    "A cost term with parameters of its own": r"weight 2: finished",
    "Dynamics of your own in a loop of your own": r"upright: 1\.0",
    "Train a pilot, and fly it": r"gates passed",
    "A set of sensors of your own, and its consistency": r"NEES \d+\.\d",
}
# They need a simulator beside them: tests/mavlink flies them.
SERVED = ("mavlink_client", "mavsdk_client")
LEARN = ("train_with_stable_baselines", "Train a pilot, and fly it")
OTHERS = [name for name in (*SCRIPTS, *RECIPES) if name not in (*LEARN, *SERVED)]
MOST_LINES = 20  # of a recipe

# One block of samples, as some examples draw them in Python
SMALLEST = SMALL | {"samples": 64}
# One gate above the start, which a vehicle has passed within a third of a second
SHORT_COURSE = quadsim.load_course("figure8").but(
    name="short",
    loop=False,
    laps=1,
    start={"position": [0, 0, 2], "yaw_deg": 0},
    gates=[{"position": [0, 0, 2.4], "yaw_deg": 0, "pitch_deg": -90, "opening": [3, 3]}],
)


class Flights:
    """Flies what a script asks for, and keeps the outcomes.

    Args:
        changed: changes the arguments of a call: (course, settings) -> (course, settings).
    """

    def __init__(self, changed: Callable):
        self.outcomes: list[str] = []
        self._changed = changed
        self._fly, self._compare, self._sweep = quadsim.fly, quadsim.compare, quadsim.sweep

    def fly(self, course, **settings):
        """Fly as `quadsim.fly`; a stored run is flown again as it is."""
        if not isinstance(course, dict):
            course, settings = self._changed(course, settings)
        run = self._fly(course, **settings)
        self.outcomes.append(run.outcome)
        return run

    def compare(self, course, variants, **settings):
        """Fly as `quadsim.compare`."""
        course, settings = self._changed(course, settings)
        found = self._compare(course, variants, **settings)
        self.outcomes += [attempt.outcome for attempt in found.attempts]
        return found

    def sweep(self, course, over, variants, **settings):
        """Fly as `quadsim.sweep`."""
        course, settings = self._changed(course, settings)
        found = self._sweep(course, over, variants, **settings)
        self.outcomes += [attempt.outcome for attempt in found.attempts]
        return found


def few_samples(course, settings):
    """Return the arguments of a call with few samples, and of a comparison with one attempt."""
    few = {**settings, "samples": SMALL["samples"]}
    return course, few | ({"attempts": 1} if "attempts" in settings else {})


def on_a_short_course(course, settings):
    """Return the arguments of a call with a small planner and a short course.

    A term of one's own is written into the planner's loop, which is not compiled, as that takes
    seconds: it is in `make docs-check`.
    """
    assert quadsim.load_course(course).gates
    small = {**settings, **SMALLEST, "laps": None, "timeout": 2.0}
    if settings.get("terms"):
        spec = quadsim.Spec.of(SHORT_COURSE, **small)
        check_cost(spec, cost_on(spec, spec.course))
        del small["terms"]
    return SHORT_COURSE, small | ({"attempts": 1} if "attempts" in settings else {})


def small_planner(mppi, system, cost, sampler, config):
    """Return a planner for a system of one's own, with the horizon that tests share."""
    return mppi(system, cost, sampler, replace(config, **SMALLEST))


@pytest.fixture
def flights_of(tmp_path, monkeypatch):
    """Return a function that makes scripts fly with changed arguments, in an empty folder."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setattr(sys, "argv", ["example"])
    monkeypatch.chdir(tmp_path)

    def patched(changed):
        flights = Flights(changed)
        monkeypatch.setattr(quadsim, "fly", flights.fly)
        monkeypatch.setattr(quadsim, "compare", flights.compare)
        monkeypatch.setattr(quadsim, "sweep", flights.sweep)
        return flights

    return patched


def run(name: str) -> None:
    """Run a script, a recipe or a notebook."""
    if "quadsim.runs" in source_of(name):
        quadsim.fly("figure8", laps=1).save()
    if name in SCRIPTS:
        runpy.run_path(str(SCRIPTS[name]), run_name="__main__")
    else:
        exec(compile(source_of(name), name, "exec"), {"__name__": "__main__"})
    plt.close("all")


def source_of(name: str) -> str:
    """Return the text of a script, a recipe or a notebook."""
    return SCRIPTS[name].read_text() if name in SCRIPTS else (RECIPES | NOTEBOOKS)[name]


@pytest.mark.compiled
@pytest.mark.parametrize("name", [*OTHERS, *NOTEBOOKS])
def test_it_runs_to_its_end_and_every_flight_finishes(name, flights_of, monkeypatch, capsys):
    flights = flights_of(on_a_short_course)
    monkeypatch.setattr(quadsim, "MPPI", partial(small_planner, quadsim.MPPI))
    run(name)
    assert capsys.readouterr().out.strip()
    source = source_of(name)
    calls = ("quadsim.fly(", "quadsim.compare(", "quadsim.sweep(")
    assert bool(flights.outcomes) == any(call in source for call in calls)
    assert set(flights.outcomes) <= {"finished"}
    for file in re.findall(r'savefig\("(.*?)"\)|plot\(run, "(.*?)"\)', source):
        assert Path("".join(file)).stat().st_size > 1000


@pytest.mark.docs
@pytest.mark.parametrize("name", OTHERS)
def test_it_prints_its_result(name, flights_of, capsys):
    flights_of(few_samples)
    run(name)
    printed = capsys.readouterr().out
    assert re.search(PRINT.get(name, "finished"), printed), printed


@pytest.mark.regression
@pytest.mark.parametrize("name", LEARN)
def test_it_learns_and_prints_its_result(name, flights_of, capsys):
    pytest.importorskip("stable_baselines3", reason="needs the extra train")
    flights_of(few_samples)
    run(name)
    printed = capsys.readouterr().out
    assert re.search(PRINT.get(name, "finished"), printed), printed


def test_a_recipe_is_short():
    lengths = {
        name: sum(bool(line.strip()) for line in source.splitlines())
        for name, source in RECIPES.items()
    }
    assert len(lengths) > 5
    assert {name: length for name, length in lengths.items() if length > MOST_LINES} == {}
