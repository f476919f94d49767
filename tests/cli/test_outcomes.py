"""A flight of any outcome is kept, reported and drawn."""

import io
import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console
from run_cases import same, save

import quadsim
from quadsim.cli.progress import Progress
from quadsim.cli.report import report, summary
from quadsim.dynamics.quadrotor import CONTROL, STATE
from quadsim.figures.run_figure import draw
from quadsim.record.archive import load_run
from quadsim.spec.build import flight_frames
from quadsim.spec.spec import Spec

OUTCOMES = ("finished", "crashed", "stuck", "timeout", "interrupted")


@pytest.fixture(scope="module")
def spec():
    return Spec.of(samples=64, horizon=10, iterations=1, timeout=0.3)


@pytest.fixture(scope="module")
def run(spec):
    return quadsim.fly(spec)


def printed(run):
    console = Console(file=io.StringIO(), width=80, highlight=False)
    for part in report(run, None, 80):
        console.print(part, soft_wrap=isinstance(part, str))
    return console.file.getvalue()


def test_telemetry_begins_with_the_first_frame(spec, run):
    first = next(iter(flight_frames(spec)))
    assert [run.telemetry[name][0] for name in (*STATE, *CONTROL)] == [*first.x, *first.u]
    assert all(np.isfinite(column).all() for column in run.telemetry.values())


def test_the_report_fits_80_columns_and_its_json_has_the_digest(run):
    text = printed(run)
    assert max(map(len, text.splitlines())) <= 80
    assert run.outcome in text.splitlines()[0]
    assert "planning" in text
    assert json.loads(json.dumps(summary(run, None), allow_nan=False))["digest"] == run.digest()


@pytest.mark.parametrize("outcome", OUTCOMES)
def test_any_outcome_is_reported_kept_and_drawn_also_without_an_event_or_a_frame(
    run, outcome, tmp_path
):
    without_events = replace(run, outcome=outcome, events=())
    no_frames = {name: column[:0] for name, column in run.telemetry.items()}
    without_frames = replace(without_events, telemetry=no_frames, snapshots=None)
    assert summary(without_events, None)["duration"] == run.telemetry["t"][-1]
    assert summary(without_frames, None)["duration"] == 0.0
    for left in (without_events, without_frames):
        assert left.laps == left.penalties == []
        assert outcome in printed(left)
        assert same(load_run(save(tmp_path, left)), left)
        draw(left)


def test_the_figure_shows_every_control_and_can_be_written(run):
    figure = draw(run)
    file = io.BytesIO()
    figure.savefig(file, dpi=30)
    assert file.getvalue().startswith(b"\x89PNG")
    every_axes = figure.findobj(lambda artist: hasattr(artist, "get_lines"))
    lines = [line for axes in every_axes for line in axes.get_lines()]
    assert sum(line.get_label() == "commanded" for line in lines) >= len(CONTROL)


def test_the_live_line_names_the_gate_and_the_speed(spec, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "120")
    with Progress(spec) as line:
        line.show(next(iter(flight_frames(spec))))
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", capsys.readouterr().err)
    assert "gate 1/7" in text
    assert "m/s" in text
