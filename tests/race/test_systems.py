"""Every system of the registry, and one of a user's own, is flown, kept, reported and drawn in the
same way."""

import io
import json
import re
import sys
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from rich.console import Console
from run_cases import same, save

import quadsim
from controllers.costs import Cost, Term
from controllers.samplers import SAMPLERS, Colored
from quadsim.cli.progress import Progress
from quadsim.cli.report import report, summary
from quadsim.dynamics import System
from quadsim.figures.run_figure import draw
from quadsim.record.archive import load_run
from quadsim.record.run import Run, columns_of
from quadsim.spec.build import flight_frames
from quadsim.spec.own_parts import own_system
from quadsim.spec.spec import Spec
from quadsim.spec.systems import SYSTEMS

SMALL = {"samples": 64, "horizon": 10, "iterations": 1, "timeout": 0.3}
OUTCOMES = ("finished", "crashed", "stuck", "timeout", "interrupted")
EVERY = [*SYSTEMS, "own"]


class State(NamedTuple):
    """A cart on a rail: its position is no px."""

    pos: float
    v: float


class Control(NamedTuple):
    """It has a name that a quadrotor's thrust has, too."""

    a_cmd: float


class Params(NamedTuple):
    gain: float


class Zero(NamedTuple):
    pos: float


def step(x, u, p, dt):
    return State(pos=x.pos + x.v * dt, v=x.v + p.gain * u.a_cmd * dt)


def place(x, x_next, u, zero, p):
    return (x_next.pos - zero.pos) * (x_next.pos - zero.pos)


def speed(x, x_next, u, zero, p):
    return x_next.v * x_next.v


CART = System("cart", State, Control, step, Params(gain=1.0), 0.02, (-9.0,), (9.0,), (0.0,))
TO_ZERO = Cost("to zero", (Term(place), Term(speed, 0.1)), Zero, np.zeros((1, 1)))
OWN = {"system": CART, "cost": TO_ZERO, "sampler": Colored((2.0,), (1.0,)), "start": (1.0, 0.0)}


def spec_of(system, seed=0):
    return Spec.of(**(OWN if system == "own" else {"system": system}), **SMALL, seed=seed)


@cache
def flown(system, seed=0):
    return quadsim.fly(spec_of(system, seed))


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_default_course_loads_and_belongs_to_the_system_by_its_name_and_its_file(
    system, tmp_path
):
    entry = SYSTEMS[system]
    assert entry.default_course in entry.courses
    course = entry.load_course(entry.default_course)
    assert entry.parse_course(course.text, "copy.yaml") == replace(course, name="copy")
    (tmp_path / "copy.yaml").write_text(course.text)
    for said in (entry.default_course, str(tmp_path / "copy.yaml")):
        assert Spec.of(said).system == system


@pytest.mark.parametrize("system", SYSTEMS)
def test_every_preset_has_samplers_of_the_registry_with_a_number_for_each_control(system):
    entry = SYSTEMS[system]
    assert entry.default_preset in entry.presets
    for preset in entry.presets.values():
        assert preset
        for name, planner in preset.items():
            assert type(planner.sampling) is SAMPLERS[name]
            assert len(planner.sampling.sigma) == len(entry.controls)
            assert planner.vehicle in entry.vehicles()


@pytest.mark.parametrize("system", EVERY)
def test_a_run_has_a_column_with_its_unit_for_time_every_state_and_every_control(system):
    run = flown(system)
    entry = own_system(CART, (1.0, 0.0)) if system == "own" else SYSTEMS[system]
    assert list(run.telemetry) == list(columns_of(run.spec)) == list(entry.columns)
    assert columns_of(run.spec) == entry.columns
    assert len(run.telemetry["t"]) > 10
    assert all(np.isfinite(column).all() for column in run.telemetry.values())
    first = next(iter(flight_frames(spec_of(system))))
    assert [run.telemetry[name][0] for name in (*entry.states, *entry.controls)] == [
        *first.x,
        *first.u,
    ]


@pytest.mark.parametrize("system", EVERY)
def test_a_run_comes_back_from_the_disk_to_the_last_bit(system, tmp_path):
    run = flown(system)
    folder = save(tmp_path, run)
    assert same(load_run(folder), run)
    assert run.snapshots is not None
    units = json.loads((folder / "run.json").read_text())["units"]
    assert units == columns_of(run.spec)


@pytest.mark.parametrize("system", EVERY)
def test_the_same_seed_gives_the_same_digest_and_another_seed_other_controls(system):
    run, again, other = flown(system), quadsim.fly(spec_of(system)), flown(system, seed=1)
    assert run.digest() == again.digest() != other.digest()
    controls = spec_of(system).entry.controls
    assert any(not np.array_equal(run.telemetry[name], other.telemetry[name]) for name in controls)


def printed(run):
    console = Console(file=io.StringIO(), width=80, highlight=False)
    for part in report(run, None, 80):
        console.print(part, soft_wrap=isinstance(part, str))
    return console.file.getvalue()


@pytest.mark.parametrize("system", EVERY)
def test_the_report_fits_80_columns_and_has_a_variation_of_every_control(system):
    run = flown(system)
    text = printed(run)
    assert max(map(len, text.splitlines())) <= 80
    assert run.outcome in text.splitlines()[0]
    assert "planning" in text
    if system != "quadrotor":  # whose control of interest is the thrust
        assert all(name in text for name in spec_of(system).entry.controls)
    assert json.loads(json.dumps(summary(run, None), allow_nan=False))["digest"] == run.digest()


@pytest.mark.parametrize("outcome", OUTCOMES)
@pytest.mark.parametrize("system", EVERY)
def test_any_outcome_is_reported_kept_and_drawn_also_without_an_event_or_a_frame(
    system, outcome, tmp_path
):
    run = replace(flown(system), outcome=outcome, events=())
    empty = replace(
        run, telemetry={name: column[:0] for name, column in run.telemetry.items()}, snapshots=None
    )
    for left in (run, empty):
        assert left.laps == left.penalties == []
        assert outcome in printed(left)
        assert summary(left, None)["duration"] == (left.telemetry["t"][-1] if left is run else 0.0)
        assert same(load_run(save(tmp_path, left)), left)
        draw(left)


@pytest.mark.parametrize("system", EVERY)
def test_the_figure_shows_every_control_and_can_be_written(system):
    figure, file = draw(flown(system)), io.BytesIO()
    figure.savefig(file, dpi=30)
    assert file.getvalue().startswith(b"\x89PNG")
    lines = [
        x for axes in figure.findobj(lambda a: hasattr(a, "get_lines")) for x in axes.get_lines()
    ]
    shown = [x for x in lines if x.get_label() == "commanded"]
    assert len(shown) >= len(spec_of(system).entry.controls)


@pytest.mark.parametrize(
    ("system", "shown"), [("quadrotor", "gate 1/7"), ("offroad", "leg 1/5"), ("own", "ESS")]
)
def test_the_live_line_names_what_is_passed(system, shown, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "120")
    spec = spec_of(system)
    with Progress(spec) as line:
        line.show(next(iter(flight_frames(spec))))
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", capsys.readouterr().err)
    assert shown in text
    assert ("m/s" in text) == (system != "own"), "the unit of a user's own state is not known"


def test_a_run_of_a_system_that_nobody_registered_is_refused():
    with pytest.raises(KeyError, match="hovercraft"):
        columns_of({"system": "hovercraft"})
    with pytest.raises(KeyError, match="hovercraft"):
        Run.from_frames({"system": "hovercraft"}, [])
