"""A flight of any outcome is kept, reported and drawn."""

import io
import json
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

import quadsim
from quadsim.cli.progress import Progress
from quadsim.cli.report import report, summary
from quadsim.config.build import flight_frames
from quadsim.config.spec import Spec
from quadsim.dynamics.quadrotor import CONTROL, STATE
from quadsim.figures.run_figure import draw
from quadsim.record.archive import read_run
from tests.run_cases import same, save, two_laps
from tests.small import SHORT

OUTCOMES = ("finished", "crashed", "stuck", "timeout", "interrupted")


@pytest.fixture(scope="module")
def spec():
    return Spec.of(**SHORT)


@pytest.fixture(scope="module")
def flown(spec):
    """A run with pictures of its planner."""
    return quadsim.fly(spec)


@pytest.fixture(scope="module")
def hovering(spec):
    """A run of 0.6 s with events and without pictures, which nothing has flown."""
    return two_laps(spec.record())


def printed(run):
    console = Console(file=io.StringIO(), width=80, highlight=False)
    for part in report(run, None, 80):
        console.print(part, soft_wrap=isinstance(part, str))
    return console.file.getvalue()


@pytest.mark.compiled
def test_telemetry_begins_with_the_first_frame(spec, flown):
    first = next(iter(flight_frames(spec)))
    assert [flown.telemetry[name][0] for name in (*STATE, *CONTROL)] == [*first.x, *first.u]
    assert all(np.isfinite(column).all() for column in flown.telemetry.values())


@pytest.mark.compiled
def test_the_report_fits_80_columns_and_its_json_has_the_digest(flown):
    text = printed(flown)
    assert max(map(len, text.splitlines())) <= 80
    assert flown.outcome in text.splitlines()[0]
    assert "planning" in text
    assert json.loads(json.dumps(summary(flown, None), allow_nan=False))["digest"] == flown.digest()


@pytest.mark.slow
@pytest.mark.parametrize("outcome", OUTCOMES)
def test_any_outcome_is_reported_kept_and_drawn_also_without_an_event_or_a_frame(
    hovering, outcome, tmp_path
):
    without_events = replace(hovering, outcome=outcome, events=())
    no_frames = {name: column[:0] for name, column in hovering.telemetry.items()}
    without_frames = replace(without_events, telemetry=no_frames)
    assert summary(without_events, None)["duration"] == hovering.telemetry["t"][-1]
    assert summary(without_frames, None)["duration"] == 0.0
    for left in (without_events, without_frames):
        assert left.laps == left.penalties == []
        assert outcome in printed(left)
        assert same(read_run(save(tmp_path, left)), left)
        assert outcome in draw(left).get_suptitle()


@pytest.mark.compiled
def test_the_figure_shows_every_control_and_can_be_written(flown):
    figure = draw(flown)
    file = io.BytesIO()
    figure.savefig(file, dpi=30)
    assert file.getvalue().startswith(b"\x89PNG")
    every_axes = figure.findobj(lambda artist: hasattr(artist, "get_lines"))
    lines = [line for axes in every_axes for line in axes.get_lines()]
    assert sum(line.get_label() == "commanded" for line in lines) >= len(CONTROL)


@pytest.mark.compiled
def test_the_live_line_names_the_gate_and_the_speed(spec, monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "120")
    with Progress(spec) as line:
        line.show(next(iter(flight_frames(spec))))
    text = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", capsys.readouterr().err)
    assert "gate 1/7" in text
    assert "m/s" in text
