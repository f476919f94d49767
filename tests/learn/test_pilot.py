"""Pilots: what is written is what is flown; a file that does not fit is one line and flies
nothing."""

import json

import numpy as np
import pytest

import quadsim
from controllers.learned.network import forward, new
from controllers.learned.observation import SIZE
from controllers.learned.pilot import About, load_pilot, pilot_bytes
from quadsim.campaign.variants import parse_variants
from quadsim.cli.cli import race
from quadsim.files.strict_yaml import FileError
from quadsim.learn.starts import hover_action
from quadsim.learn.task import task


@pytest.fixture
def hovering(tmp_path):
    """A pilot that hovers, as a file."""
    return write(tmp_path / "hover.npz")


def write(path, vehicle="swift", dt=0.01, sizes=(SIZE, 8, 8, 4), **about):
    system = task("split_s_swift", "swift").system
    weights = new(sizes, np.random.default_rng(0))
    weights[-1][:4] = hover_action(task("split_s_swift", "swift").vehicle, 0.01)
    said = {
        "vehicle": vehicle,
        "dt": dt,
        "hold": 2,
        "low": system.low,
        "high": system.high,
        "course": "any",
    } | about
    path.write_bytes(pilot_bytes(weights, About(**said)))
    return path


def test_a_pilot_flies_by_its_file_and_the_run_keeps_its_digest(hovering):
    run = quadsim.fly("split_s_swift", pilot=str(hovering), timeout=1.0)
    assert run.spec["pilot"] == {"name": "hover", "sha256": load_pilot(hovering).digest}
    assert run.spec["sampler"] == "pilot"
    assert np.ptp(run.telemetry["pz"]) < 0.5
    # each action is held
    assert np.array_equal(run.telemetry["wx_cmd"][0:100:2], run.telemetry["wx_cmd"][1:101:2])
    assert len(np.unique(run.telemetry["wx_cmd"])) > 10


def test_a_report_names_the_pilot_and_nothing_of_a_planner(hovering, tmp_path, capsys):
    flags = ["--pilot", str(hovering), "--timeout", "0.5", "--runs-dir", str(tmp_path)]
    assert race(["fly", "split_s_swift", *flags]) == 1
    out = capsys.readouterr().out
    assert "pilot hover, vehicle swift, seed 0" in out
    assert not [
        word for word in ("sampling", "preset", "ESS", "estimated in flight") if word in out
    ]


def test_what_is_read_is_what_was_written(tmp_path):
    weights = new((SIZE, 8, 8, 4), np.random.default_rng(0))
    pilot, obs = load_pilot(write(tmp_path / "p.npz")), np.linspace(-1, 1, SIZE, dtype=np.float32)
    weights[-1][:] = pilot.weights[-1]
    np.testing.assert_array_equal(pilot(obs), np.clip(forward(weights, obs), -1, 1))


def broken(path):
    """Files that are no pilots, and what is said of them."""
    whole = path.read_bytes()
    with np.load(path) as arrays:
        kept = dict(arrays)
    text = json.loads(str(kept["about"]))

    def but(**changes):
        np.savez(path, **(kept | changes))
        return path.read_bytes()

    yield whole[:200], "that is no .npz"
    yield b"", "that is no .npz"
    yield but(about=np.array(json.dumps(text | {"format": "x"}))), "expected format"
    yield (
        but(about=np.array(json.dumps(text | {"observes": ["height"]}))),
        "observes the 38 numbers",
    )
    yield but(layer_0=np.full_like(kept["layer_0"], np.nan)), "expected finite weights in layer 1"
    yield but(layer_2=kept["layer_0"]), "expected layer 2 with 8 inputs"
    yield but(layer_1=np.array([{"a": 1}], dtype=object)), "cannot be read"


def test_a_damaged_file_is_one_line(hovering):
    for data, said in list(broken(hovering)):
        hovering.write_bytes(data)
        with pytest.raises(FileError, match=said) as error:
            load_pilot(hovering)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("about", "flags", "said"),
    [
        (
            {},
            ["--vehicle", "kingfisher"],
            "expected the vehicle it was trained for, swift, got kingfisher",
        ),
        ({}, ["--dt", "0.02"], "dt: expected the 0.01 s it was trained for, got 0.02"),
    ],
)
def test_a_pilot_for_something_else_is_one_line_and_exit_code_2(
    tmp_path, capsys, about, flags, said
):
    path = write(tmp_path / "p.npz", **about)
    assert (
        race(["fly", "split_s_swift", "--pilot", str(path), *flags, "--runs-dir", str(tmp_path)])
        == 2
    )
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["train", "nowhere"], "race train: no course 'nowhere'"),
        (["train", "split_s_swift", "--vehicle", "swifd"], "no vehicle 'swifd'"),
        (
            ["train", "split_s_swift", "--out", "pilot.zip"],
            "--out: expected FILE.npz, got 'pilot.zip'",
        ),
        (["train", "empty"], "course: expected a folder of courses, found no *.yaml in 'empty'"),
        (
            ["fly", "split_s_swift", "--pilot", "damaged.npz"],
            "damaged.npz: expected a pilot as `race train` writes it",
        ),
    ],
)
def test_wrong_words_are_one_line_and_exit_code_2(
    hovering, tmp_path, monkeypatch, capsys, words, said
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "damaged.npz").write_bytes(hovering.read_bytes()[:300])
    assert race(words) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


def test_no_file_is_one_line(tmp_path, capsys):
    assert race(["fly", "--pilot", str(tmp_path / "none.npz"), "--runs-dir", str(tmp_path)]) == 2
    assert (
        "none.npz': expected FILE.npz, or one that comes with quadsim: " in capsys.readouterr().err
    )


def test_a_variant_of_a_comparison_can_be_a_pilot(hovering):
    assert parse_variants(f"colored,learned={hovering}") == {
        "colored": {"sampler": "colored"},
        "learned": {"pilot": str(hovering)},
    }
    assert parse_variants("p=split_s_swift") == {"p": {"pilot": "split_s_swift"}}


@pytest.mark.parametrize("seed", [0, 1])
def test_the_pilot_that_comes_with_the_project_finishes_its_race(seed):
    run = quadsim.fly("split_s_swift", pilot="split_s_swift", randomize=1.0, seed=seed)
    assert run.outcome == "finished"
    assert len(run.laps) == 3
