"""Pilots: what is written is what is flown, and a file that does not fit flies nothing."""

import json
import os

import numpy as np
import pytest

import quadsim
from quadsim.campaign.run.variants import parse_variants
from quadsim.cli.cli import race
from quadsim.controllers.learned.observation import SIZE
from quadsim.controllers.learned.pilot import About, forward, load_pilot, pilot_bytes, pilot_names
from quadsim.files.strict_yaml import FileError
from quadsim.learn.starts import hover_action
from quadsim.learn.task import task

HIDDEN = 8
TASK = task("split_s_swift", "swift")


def hovering_weights():
    """Return a network that hovers, whatever it observes nearly."""
    rng = np.random.default_rng(0)
    weights = []
    for inputs, outputs in ((SIZE, HIDDEN), (HIDDEN, HIDDEN), (HIDDEN, 4)):
        gain = 0.003 if outputs == 4 else 0.3
        weights.append(gain * rng.normal(size=(inputs, outputs)).astype(np.float32))
        weights.append(np.zeros(outputs, np.float32))
    weights[-1][:] = hover_action(TASK.vehicle, 0.01)
    return weights


def write(path, **about):
    """Write the pilot that hovers; `about` replaces what its file says."""
    system = TASK.system
    record = {
        "vehicle": "swift",
        "dt": 0.01,
        "hold": 2,
        "low": system.low,
        "high": system.high,
        "course": "any",
        "activation": "tanh",
        "output": "clip",
        "vehicle_sha256": "",
    }
    path.write_bytes(pilot_bytes(hovering_weights(), About(**record | about)))
    return path


@pytest.fixture
def hovering(tmp_path):
    """A pilot that hovers, as a file."""
    return write(tmp_path / "hover.npz")


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
    assert "pilot hover" in out
    assert "sampling" not in out
    assert "ESS" not in out


def test_what_is_read_is_what_was_written(hovering):
    pilot = load_pilot(hovering)
    obs = np.linspace(-1, 1, SIZE, dtype=np.float32)
    for found, written in zip(pilot.weights, hovering_weights(), strict=True):
        np.testing.assert_array_equal(found, written)
    np.testing.assert_array_equal(
        pilot(obs), np.clip(forward(hovering_weights(), obs, "tanh"), -1, 1)
    )


def test_a_network_is_tanh_of_affine_maps():
    x = np.array([0.5, -1.0])
    first, second = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[1.0], [-2.0]])
    a, b = np.tanh(0.5 - 3.0 + 0.1), np.tanh(1.0 - 4.0 + 0.2)
    found = forward([first, np.array([0.1, 0.2]), second, np.array([0.3])], x, "tanh")
    assert found == pytest.approx([a - 2.0 * b + 0.3])


def damaged(path):
    """Yield contents that are no pilot, each with the name of what is wrong."""
    whole = path.read_bytes()
    with np.load(path) as arrays:
        kept = dict(arrays)
    about = json.loads(str(kept["about"]))

    def but(**changes):
        np.savez(path, **(kept | changes))
        return path.read_bytes()

    def saying(**changes):
        return but(about=np.array(json.dumps(about | changes)))

    yield whole[:200], "zip"
    yield b"", "zip"
    yield saying(format="x"), "format"
    yield saying(observes=["height"]), "observes"
    yield saying(dt=0.0), "dt"
    yield saying(dt="0.01"), "dt"
    yield saying(dt=1e308), "dt"
    yield saying(dt=True), "dt"
    yield saying(hold="2"), "hold"
    yield saying(hold=1.5), "hold"
    yield saying(hold=True), "hold"
    yield saying(hold=0), "hold"
    yield saying(hold=2**70), "hold"
    yield saying(low=["-1", "-1", "-1", "0"]), "low"
    yield saying(low="1234"), "low"
    yield saying(low=about["low"][:3]), "low"
    yield saying(high=[1e308] * 4), "high"
    yield saying(high=[True] * 4), "high"
    yield saying(low=about["high"], high=about["low"]), "lower limit"
    yield saying(low=about["high"]), "lower limit"
    yield saying(vehicle=3), "vehicle"
    yield saying(vehicle="../mine"), "vehicle"
    yield saying(course=None), "course"
    yield saying(training=[]), "training"
    yield but(about=np.array(json.dumps(about).replace("0.01", "NaN"))), "about|JSON"
    yield but(about=np.array('{"training": ' + "[" * 100_000)), "recursion|JSON"
    yield saying(wings=2), "wings"
    yield but(about=np.array("[]")), "object"
    yield but(layer_0=np.full_like(kept["layer_0"], np.nan)), "layer_0"
    yield but(layer_0=np.full_like(kept["layer_0"], 3e38)), "layer_0"
    yield but(layer_0=kept["layer_0"].astype(bool)), "layer_0"
    yield but(layer_0=kept["layer_0"].astype(complex)), "layer_0"
    yield but(layer_2=kept["layer_0"]), "layer_2"
    yield but(layer_1=np.array([{"a": 1}], dtype=object)), "layer_1"


def test_a_pilot_that_is_no_regular_file_is_one_line(tmp_path):
    os.mkfifo(tmp_path / "pipe.npz")
    (tmp_path / "zero.npz").symlink_to("/dev/zero")
    (tmp_path / "loop.npz").symlink_to("loop.npz")
    (tmp_path / "folder.npz").mkdir()
    for name in ("pipe", "zero", "loop", "folder", "none"):
        with pytest.raises(FileError) as error:
            load_pilot(tmp_path / f"{name}.npz")
        assert name in str(error.value)
        assert "\n" not in str(error.value)


def test_a_damaged_file_is_one_line(hovering):
    for data, problem in list(damaged(hovering)):
        hovering.write_bytes(data)
        with pytest.raises(FileError, match=problem) as error:
            load_pilot(hovering)
        assert str(error.value).startswith(str(hovering))
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("flags", "problem"),
    [
        (["--vehicle", "kingfisher"], "trained for, swift, got kingfisher"),
        (["--dt", "0.02"], "dt: "),
    ],
)
def test_a_pilot_for_something_else_is_refused(hovering, tmp_path, capsys, flags, problem):
    given = ["--pilot", str(hovering), *flags, "--runs-dir", str(tmp_path)]
    assert race(["fly", "split_s_swift", *given]) == 2
    err = capsys.readouterr().err
    assert problem in err
    assert err.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "flags",
    [
        ["--samples", "64"],
        ["--sampler", "gaussian"],
        ["--horizon", "40"],
        ["--sigma", "1", "1", "1", "1"],
        ["--progress", "2"],
        ["--preset", "paper"],
        ["--term", "mine:calm=1"],
        ["--deadline-ms", "5"],
    ],
    ids=" ".join,
)
def test_a_setting_that_a_pilot_would_ignore_is_refused(hovering, tmp_path, capsys, flags):
    given = ["--pilot", str(hovering), *flags, "--runs-dir", str(tmp_path)]
    assert race(["fly", "split_s_swift", *given]) == 2
    err = capsys.readouterr().err
    assert f"{flags[0]}: expected none beside " in err
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (["train", "nowhere"], "nowhere"),
        (["train", "split_s_swift", "--vehicle", "swifd"], "swifd"),
        (["train", "split_s_swift", "--out", "pilot.zip"], "--out"),
        (["train", "empty"], "empty"),
        (["fly", "split_s_swift", "--pilot", "damaged.npz"], "damaged.npz"),
        (["fly", "--pilot", "none.npz"], "none.npz"),
    ],
)
def test_a_wrong_argument_is_one_line_and_exit_code_2(
    hovering, tmp_path, monkeypatch, capsys, arguments, problem
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "damaged.npz").write_bytes(hovering.read_bytes()[:300])
    assert race(arguments) == 2
    err = capsys.readouterr().err
    assert problem in err
    assert err.count("\n") == 1


def test_a_variant_of_a_comparison_can_be_a_pilot(hovering):
    assert parse_variants(f"colored,learned={hovering}") == {
        "colored": {"sampler": "colored"},
        "learned": {"pilot": str(hovering)},
    }
    assert parse_variants("p=split_s_swift") == {"p": {"pilot": "split_s_swift"}}


def finishes(name, laps):
    """Claim that a pilot that comes with the project finishes a race of so many laps."""
    course = quadsim.load_course(load_pilot(name).about.course)
    run = quadsim.fly(course, pilot=name, randomize=1.0, seed=0, laps=laps or course.laps)
    assert run.outcome == "finished"
    assert len(run.laps) == (laps or course.laps)


@pytest.mark.slow
@pytest.mark.parametrize("name", pilot_names())
def test_a_pilot_that_comes_with_the_project_finishes_a_lap(name):
    finishes(name, 1)


@pytest.mark.regression
@pytest.mark.parametrize("name", pilot_names())
def test_a_pilot_that_comes_with_the_project_finishes_its_race(name):
    finishes(name, None)
