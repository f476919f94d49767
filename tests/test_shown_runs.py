"""Claims about a Run as its user meets it: printed, in a notebook, measured, stored, exported."""

import base64
import csv
import io
import re
import sys
from dataclasses import asdict, replace

import numpy as np
import pytest
from matplotlib import pyplot
from matplotlib.image import imread
from rich.markup import escape
from run_cases import event, frame, same, two_laps

import quadsim
from quadsim.cli.cli import race
from quadsim.console import complain, emit, plain_table, progress_console
from quadsim.figures.notebook_figure import NotebookFigure
from quadsim.record.run import columns_of
from quadsim.report.metrics import chatter, splits
from tests.small import SHORT

# A text that would be an element of HTML, and one that would move a terminal's cursor
ELEMENT = "<img src=x onerror=alert(1)>"
CONTROL = "\x1b[2J"


def record(**settings):
    """Return the spec of a race of two laps."""
    return quadsim.Spec.of("split_s_swift", laps=2, **settings).record()


def shown(outcome="finished", **settings):
    """Return a Run made by hand, with two laps of three gates each."""
    return quadsim.Run.of(two_laps(record(**settings), outcome))


def crashed(kind="hit", gate=3, obstacle=0):
    """Return a run that ended within its first lap."""
    last = replace(event(0.02, kind, gate), obstacle=obstacle)
    frames = [frame(0), frame(1), frame(2, events=(last,), outcome="crashed")]
    return quadsim.Run.from_frames(record(), frames)


@pytest.fixture(scope="module")
def sensed():
    """A flight with sensors."""
    return quadsim.fly("figure8", sensing="mocap", **SHORT)


def test_repr_is_one_short_line_and_print_one_paragraph():
    run = shown()
    assert len(repr(run)) < 200
    assert "\n" not in repr(run)
    assert "\n" not in str(run)
    assert len(str(run)) < 700
    for text in (repr(run), str(run)):
        for said in ("split_s_swift", "finished", "2 of 2 laps", "colored", "swift", "seed 0"):
            assert said in text


def test_print_tells_lap_times_chatter_and_planning_time():
    run = shown()
    text = str(run)
    assert all(f"{lap:.3f}" in text for lap in run.laps)
    assert f"{run.metrics.thrust_tv:.1f} m/s^2" in text
    assert f"{run.metrics.plan_ms_p50:.1f} ms" in text


PLACES = (
    (crashed(), "it hit gate 3 in lap 1"),
    (crashed(gate=0, obstacle=2), "it hit obstacle 2 in lap 1"),
    (crashed("ground", 0), "it hit the ground in lap 1"),
    (crashed("bounds", 0), "it left the bounds in lap 1"),
    (shown("crashed"), "the planner raised an error"),
)


def lost(run, off, turned=0.0, outcome="crashed"):
    """Return a run whose estimate is off by these distances in x [m], in the end turned [deg]."""
    x = dict(run.telemetry)
    x["est_px"] = x["px"] + off
    for name in ("qw", "qx", "qy", "qz"):
        x[f"est_{name}"] = x[name].copy()
    half = np.radians(turned / 2)
    last = [x[name][-1] for name in ("qw", "qx", "qy", "qz")]
    # turned about z from behind
    w, a, b, c = last
    cos, sin = np.cos(half), np.sin(half)
    turned_q = (w * cos - c * sin, a * cos + b * sin, b * cos - a * sin, c * cos + w * sin)
    for name, number in zip(("qw", "qx", "qy", "qz"), turned_q, strict=True):
        x[f"est_{name}"][-1] = number
    for name in ("py", "pz"):
        x[f"est_{name}"] = x[name]
    return replace(run, telemetry=x, outcome=outcome)


@pytest.mark.compiled
def test_a_report_says_how_far_off_the_estimate_was_and_since_when(sensed):
    frames = len(sensed.telemetry["t"])
    grows = np.linspace(0.0, 2.4, frames)
    since = sensed.telemetry["t"][np.flatnonzero(grows <= 0.5)[-1] + 1]
    line = f"stimate 2.4 m off at the end, more than 0.5 m from {since:.1f} s on"
    for outcome in ("crashed", "timeout"):
        run = lost(sensed, grows, outcome=outcome)
        assert f"e{line}" in run.report()
        assert f"E{line}." in str(run)
        assert line.removeprefix("stimate ") in run._repr_html_()
    turned = lost(sensed, np.full(frames, 0.02), turned=40.0)
    assert "estimate 2.0 cm and 40 deg off at the end\n" in turned.report()
    good = np.full(frames, 0.02)
    assert "estimate 2.0 cm off at the end\n" in lost(sensed, good).report()
    assert "off at the end" not in lost(sensed, good, outcome="finished").report()
    # It was lost for a while, and found again.
    assert "more than" not in lost(sensed, np.linspace(2.4, 0.0, frames)).report()
    assert "off at the end" not in crashed().report()


def test_a_table_of_incidents_has_their_places():
    run = crashed("bounds", 0)
    x, y, z = run.events[-1].position
    assert f"{x:.1f}, {y:.1f}, {z:.1f}" in run.report().partition("bounds  ")[2]
    assert f"it left the bounds in lap 1, at ({x:.1f}, {y:.1f}, {z:.1f}) m" in run.report()


def test_a_crashed_run_tells_where_it_crashed():
    for run, place in PLACES:
        assert place in str(run)
    run, place = PLACES[0]
    assert place in run._repr_html_()


@pytest.mark.slow
def test_a_run_without_a_single_frame_is_shown_too():
    run = quadsim.Run.from_frames(record(), [])
    assert "0 of 2 laps" in str(run)
    assert "<img" in run._repr_html_()
    assert run.metrics.best_lap is None
    assert run.metrics.top_speed == 0.0
    assert run.to_pandas().empty


def test_the_limit_is_in_print_report_and_metrics_where_one_is_known():
    run = quadsim.Run.of(two_laps(quadsim.Spec.of("split_s_swift", laps=3).record()))
    metrics = run.metrics
    assert metrics.limit is not None
    assert metrics.above_limit is not None
    assert metrics.above_limit == pytest.approx(run.duration / metrics.limit - 1.0)
    said = f"{100 * metrics.above_limit:.1f} % above the best known limit of {metrics.limit:.3f} s"
    for text in (str(run), run.report(), run._repr_html_()):
        assert said in text
    unfinished = quadsim.Run.of(replace(run, outcome="timeout"))
    assert unfinished.metrics.limit == metrics.limit
    assert unfinished.metrics.above_limit is None


def test_the_notebook_shows_a_picture_and_leaves_matplotlib_as_it_was():
    before = dict(pyplot.rcParams), pyplot.get_backend(), pyplot.get_fignums()
    html = shown()._repr_html_()
    assert (dict(pyplot.rcParams), pyplot.get_backend(), pyplot.get_fignums()) == before
    (source,) = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    picture = imread(io.BytesIO(base64.b64decode(source)))
    assert picture.shape[1] <= 800
    assert picture[..., :3].std() > 0.05, "not a blank page"
    assert len(html) < 100_000


@pytest.mark.slow
def test_a_notebook_shows_the_figure_of_a_run():
    figure = quadsim.plot(shown())
    assert isinstance(figure, NotebookFigure)
    picture = imread(io.BytesIO(figure._repr_png_()))
    assert 800 < picture.shape[1] < 1200
    assert picture[..., :3].std() > 0.05, "not a blank page"


def with_texts(keys):
    """Return a run whose spec has hostile texts, each with its key."""
    run = shown()
    texts = {key: ELEMENT.replace("x", key) + CONTROL for key in keys}
    for part in ("course", "vehicle"):
        if part in texts:
            texts[part] = run.spec[part] | {"name": texts[part]}
    return quadsim.Run.of(replace(run, spec=run.spec | texts))


def test_no_text_of_a_run_becomes_html_or_moves_the_cursor():
    keys = ("course", "sampler", "preset", "vehicle")
    run = with_texts(keys)
    html = run._repr_html_()
    assert "<img src=" not in html.replace('<img src="data:', "")
    for key in keys:
        assert f"&lt;img src={key}" in html
    # A report is of a spec as it is stored, in which courses have no such names
    texts = [html, str(run), repr(run), with_texts(keys[1:]).report()]
    assert not any("\x1b" in text for text in texts)


@pytest.mark.parametrize(
    "code", ["\x1b[2J", "\x1b[8m", "\x1b]0;title\x07", "\x9b31m", "\r", "\x00"]
)
def test_no_control_character_of_a_stored_text_reaches_a_terminal(code, capsys, monkeypatch):
    """Not even a colour: a text that is hidden (\\x1b[8m) is another report."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    name = f"a{code}b"
    table = plain_table("name", left=(0,))
    table.add_row(escape(name))
    emit(f"[bold]{escape(name)}[/]", table)
    complain(name)
    console = progress_console()
    console.print(escape(name))
    said = capsys.readouterr()
    assert f"a{repr(code)[1:-1]}b\n" in said.err
    assert "\x1b[1m" in said.out  # the command's own colours
    assert code not in said.out + said.err


def test_the_report_is_that_of_the_command_without_colours(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "90")
    run = shown()
    folder = run.save(tmp_path)
    assert race(["show", str(folder), "--runs-dir", str(tmp_path)]) == 0
    printed, _, stored = capsys.readouterr().out.rpartition("\n\nstored in ")
    assert stored.strip() == str(folder)
    assert run.report(columns=90) == printed


def test_metrics_are_those_of_the_report():
    run = shown()
    metrics = run.metrics
    measured = chatter(run)
    assert metrics.thrust_tv == measured["commanded"]["thrust_tv"]
    assert metrics.thrust_tv_delivered == measured["delivered"]["thrust_tv"]
    assert metrics.rates_tv == measured["commanded"]["body_rates_tv"]
    assert metrics.rates_tv_delivered == measured["delivered"]["body_rates_tv"]
    assert [list(lap) for lap in metrics.splits] == splits(run)
    assert list(metrics.laps) == run.laps
    assert metrics.best_lap == min(run.laps)
    assert metrics.race_time == sum(run.laps)
    assert metrics.nees is None


def test_speed_and_length_of_a_straight_flight_are_known():
    """The frames move .3 m along x each period of .01 s, and say that they fly at 5 m/s."""
    metrics = shown().metrics
    assert metrics.path_length == pytest.approx(60 * 0.3)
    assert metrics.mean_speed == pytest.approx(30.0)
    assert metrics.top_speed == pytest.approx(5.0)


@pytest.mark.compiled
def test_metrics_of_a_flight_with_sensors_have_the_estimates_errors(sensed):
    metrics = sensed.metrics
    assert metrics.nees == pytest.approx(sensed.telemetry["nees"].mean())
    assert 0.0 < metrics.position_rms < 0.5


@pytest.mark.compiled
def test_pandas_has_every_number_of_the_telemetry_by_time(sensed):
    pytest.importorskip("pandas")
    frame = sensed.to_pandas()
    assert frame.index.name == "t"
    assert np.array_equal(frame.index, sensed.telemetry["t"])
    assert ["t", *frame.columns] == list(sensed.telemetry)
    for name in frame.columns:
        assert np.array_equal(frame[name], sensed.telemetry[name])
    assert frame.attrs["units"] == columns_of(sensed.spec)


def test_pandas_has_a_row_for_each_event_as_the_stored_table(tmp_path):
    pandas = pytest.importorskip("pandas")
    run = shown()
    stored = pandas.read_csv(run.save(tmp_path) / "events.csv")
    pandas.testing.assert_frame_equal(run.events_to_pandas(), stored)


def test_a_missing_package_is_one_line_that_says_what_to_install(monkeypatch):
    run = shown()
    for module in ("pandas", "mcap_protobuf", "mcap_protobuf.writer"):
        monkeypatch.setitem(sys.modules, module, None)
    for ask in (run.to_pandas, run.events_to_pandas, lambda: run.export("x.mcap")):
        with pytest.raises(ModuleNotFoundError, match=r"is not installed: .* -m pip install") as e:
            ask()
        assert "\n" not in str(e.value)


@pytest.mark.slow
def test_a_run_stores_and_draws_itself_as_the_functions_do(tmp_path, monkeypatch):
    run = shown()
    again = quadsim.load_run(run.save(tmp_path / "a"))
    assert isinstance(again, quadsim.Run)
    assert same(again, run)
    assert same(quadsim.load_run(quadsim.save_run(run, tmp_path / "b")), run)
    run.plot(tmp_path / "run.svg")
    assert (tmp_path / "run.svg").read_text().count("<path") > 50
    asked = []
    monkeypatch.setattr(quadsim.Run, "plot", lambda *arguments: asked.append(arguments))
    quadsim.plot(run, "function.svg")
    assert asked == [(run, "function.svg")]


def test_export_writes_the_kind_that_the_name_ends_with(tmp_path):
    run = shown()
    path = run.export(tmp_path / "flown.csv")
    head, *rows = csv.reader(path.open())
    assert head == [f"{name} [{unit}]" for name, unit in columns_of(run.spec).items()]
    assert [float(row[1]) for row in rows] == run.telemetry["px"].tolist()
    with pytest.raises(ValueError, match=r"expected FILE.csv or FILE.mcap, got '.*x.txt'"):
        run.export(tmp_path / "x.txt")
    with pytest.raises(quadsim.RunError, match=r"flown\.csv"):
        run.export(path / "x.csv")


def test_metrics_can_be_a_row_of_a_table():
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame([asdict(shown().metrics), asdict(crashed().metrics)])
    assert table["race_time"].isna().tolist() == [False, True]
