"""Training: a pilot is written, and a training goes on where it was."""

import json
import re
import shutil
import sys
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from quadsim.cli import train as command
from quadsim.cli.cli import race
from quadsim.cli.train import progress_text
from quadsim.controllers.learned.pilot import load_pilot, pilot_bytes
from quadsim.files.strict_yaml import FileError
from quadsim.learn import training as training_module
from quadsim.learn.checkpoint import Checkpoint, checkpoint_bytes, read_checkpoint
from quadsim.learn.ppo_config import PPOConfig
from quadsim.learn.training import Clock, EvaluatedRaces, Progress, Score, Training, learning_rate
from quadsim.vehicle.vehicle import VEHICLES
from tests.fuzz import learner

CONFIG = PPOConfig()
NETWORK = {
    "weight": np.arange(6, dtype=np.float32).reshape(2, 3),
    "bias": np.zeros(3, np.float32),
}


def trains(course, steps, *flags):
    """Train with sizes that take seconds."""
    sizes = ["--laps", "1", "--environments", "128", "--hidden", "8", "--flights", "1"]
    return race(["train", course, *sizes, "--steps", str(steps), *flags])


def test_a_pilot_that_finishes_is_better_than_a_fast_one_that_does_not():
    half = Score.of({"flights": 4, "finished": 0.5, "lap": 5.0, "gates": 0.9})
    slow = Score.of({"flights": 4, "finished": 1.0, "lap": 9.0, "gates": 1.0})
    fast = Score.of({"flights": 4, "finished": 1.0, "lap": 8.0, "gates": 1.0})
    none = Score.of({"flights": 4, "finished": 0.0, "lap": 0.0, "gates": 0.9})
    assert sorted([fast, none, slow, half]) == [none, half, slow, fast]


def test_a_pilot_of_many_flights_is_better_than_one_that_was_lucky_in_few():
    many = Score.of({"flights": 16, "finished": 0.9, "lap": 5.0, "gates": 1.0})
    few = Score.of({"flights": 4, "finished": 1.0, "lap": 4.9, "gates": 1.0})
    assert few < many


def row(steps, **numbers):
    """Return an evaluation."""
    usual = {
        "reward": 1.5,
        "flights": 4,
        "finished": 0.5,
        "lap": 9.5,
        "gates": 0.75,
        "seconds": 3.0,
    }
    return {"steps": steps} | usual | numbers


HISTORY = [row(10), row(20, reward=2.5)]


def write(path, network=NETWORK, history=HISTORY, **identity):
    """Write a checkpoint."""
    checkpoint = Checkpoint(network, history[-1]["steps"], history)
    path.write_bytes(checkpoint_bytes(checkpoint, {"seed": 0} | identity))
    return path


def test_a_checkpoint_is_read_as_it_was_written(tmp_path):
    path = write(tmp_path / "p.checkpoint.npz", laps=(1, 2))
    found = read_checkpoint(path, NETWORK, {"seed": 0, "laps": (1, 2)})
    assert found.history == HISTORY
    assert found.steps_done == 20
    for name, array in NETWORK.items():
        np.testing.assert_array_equal(found.parameters[name], array)


@pytest.mark.parametrize(
    ("network", "identity", "problem"),
    [
        (NETWORK, {"seed": 1}, "same seed"),
        (NETWORK, {"seed": 0, "vehicle": {"mass": 1.9}}, "same vehicle.mass: "),
        (NETWORK, {"seed": 0, "more": 1}, "same more, vehicle: "),
        (NETWORK | {"bias": np.zeros(4, np.float32)}, {"seed": 0}, "bias"),
        (NETWORK | {"more": np.zeros(4, np.float32)}, {"seed": 0}, "more"),
    ],
)
def test_a_checkpoint_of_another_training_is_refused(tmp_path, network, identity, problem):
    path = write(tmp_path / "p.checkpoint.npz", vehicle={"mass": 0.87, "radius": 0.2})
    asked = {"vehicle": {"mass": 0.87, "radius": 0.2}} if "more" not in identity else {}
    if "vehicle" in identity:
        identity = identity | {"vehicle": asked["vehicle"] | identity["vehicle"]}
    with pytest.raises(FileError, match=problem):
        read_checkpoint(path, network, asked | identity)


STATES = {
    "an earlier version": ({"format": "quadsim training 4"}, "training 4"),
    "a version of control characters": ({"format": "\x1b[2J"}, "format"),
    "a version of a number": ({"format": 4}, "format"),
    "text for steps": ({"steps_done": "20"}, "steps_done"),
    "steps of a number": ({"steps_done": 20.5}, "steps_done"),
    "negative steps": ({"steps_done": -1}, "steps_done"),
    "true for steps": ({"steps_done": True}, "steps_done"),
    "steps beyond the history's": ({"steps_done": 30}, "steps_done"),
    "steps without an end": ({"steps_done": 2**70}, "steps_done"),
    "no history": ({"history": []}, "history"),
    "a history of text": ({"history": "rows"}, "history"),
    "a row of a list": ({"history": [[1]]}, "history"),
    "a row without a number": ({"history": [{"steps": 20}]}, "history"),
    "a reward of text": ({"history": [row(20, reward="2.5")]}, "reward"),
    "a far reward": ({"history": [row(20, reward=1e308)]}, "reward"),
    "a share above 1": ({"history": [row(20, finished=1.5)]}, "finished"),
    "a negative lap": ({"history": [row(20, lap=-1.0)]}, "lap"),
    "a history that goes back": ({"history": [row(30), row(20)]}, "history"),
    "an identity of text": ({"identity": "mine"}, "identity"),
    "an identity of strange names": ({"identity": {"\x1b[2J": 1}}, "same"),
    "an unknown key": ({"wings": 2}, "wings"),
}


@pytest.mark.parametrize("name", STATES)
def test_a_damaged_checkpoint_is_one_line(name, tmp_path):
    changes, problem = STATES[name]
    path = write(tmp_path / "p.checkpoint.npz")
    with np.load(path) as arrays:
        kept = dict(arrays)
    state = json.loads(str(kept["state"])) | changes
    np.savez(path, **kept | {"state": np.array(json.dumps(state))})
    with pytest.raises(FileError, match=problem) as error:
        read_checkpoint(path, NETWORK, {"seed": 0})
    assert str(error.value).startswith(f"{path}: expected ")
    assert str(error.value).isprintable()


def test_a_parameter_that_would_overflow_is_refused(tmp_path):
    network = NETWORK | {"bias": np.full(3, 3e38, np.float32)}
    with pytest.raises(FileError, match="bias"):
        read_checkpoint(write(tmp_path / "c.npz", network), NETWORK, {"seed": 0})


NEAR = """
opening: [1.6, 1.6]
start: {position: [0, 0, 1.5], yaw_deg: 0}
gates:
  - {position: [1.5, 0, 1.5], yaw_deg: 0}
"""


def set_up(patch, folder):
    """Work in a folder with a course and a vehicle, where `race train` needs no PyTorch."""
    patch.chdir(folder)
    patch.setitem(sys.modules, "quadsim.learn.ppo", learner.module())
    patch.setattr(command, "find_spec", learner.is_installed)
    (folder / "near.yaml").write_text(NEAR)
    (folder / "v.yaml").write_text((VEHICLES / "swift.yaml").read_text())


def leave_out_flights(patch):
    """Let evaluations and the plot take no time; the fixture `trained` has a real one of each."""
    flown = EvaluatedRaces(finished=0.0, lap=0.0, gates=0.5)
    patch.setattr(training_module, "evaluate", lambda pilot, task, flights: flown)
    patch.setattr(command, "_plot", lambda history, path, title: None)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Return a folder in which a training can begin."""
    set_up(monkeypatch, tmp_path)
    leave_out_flights(monkeypatch)
    return tmp_path


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """Return a folder in which 4096 steps of a training have been made."""
    folder = tmp_path_factory.mktemp("trained")
    with pytest.MonkeyPatch.context() as patch:
        set_up(patch, folder)
        assert learns(4096) == 0
    return folder


@pytest.fixture
def begun(trained, tmp_path, monkeypatch):
    """Return a folder with a training that can go on."""
    folder = tmp_path / "begun"
    shutil.copytree(trained, folder)
    set_up(monkeypatch, folder)
    leave_out_flights(monkeypatch)
    return folder


def learns(steps, *flags, out="p.npz"):
    """Train with the fake learner, whose update is 4096 steps; return the exit code."""
    sizes = ["--environments", "64", "--hidden", "8", "--flights", "1", "--randomize", "0"]
    given = ["--vehicle", "v.yaml", *sizes, "--steps", str(steps), "--out", out, *flags]
    return race(["train", "near.yaml", *given])


def steps_of(path):
    """Return the steps after which the pilot in a file was evaluated."""
    return load_pilot(path).about.training["evaluated"]["steps"]


@pytest.mark.slow
def test_a_training_flies_its_pilot_in_the_simulator_and_draws_how_it_learnt(trained):
    about = load_pilot(trained / "p.npz").about
    found = about.training["evaluated"]
    # The fake learner's pilot hovers.
    assert (found["flights"], found["finished"], found["lap"], found["gates"]) == (1, 0.0, 0.0, 0.0)
    assert found["steps"] == about.training["steps"] == 4096
    assert (trained / "p.png").stat().st_size > 1000


def with_other_mass(folder):
    """Change the vehicle of a folder; return its text before."""
    text = (folder / "v.yaml").read_text()
    (folder / "v.yaml").write_text(re.sub(r"(?m)^mass: \S+", "mass: 0.9", text))
    return text


def test_a_training_goes_on_with_its_own_vehicle_alone(begun, capsys):
    before = (begun / "p.npz").read_bytes()
    text = with_other_mass(begun)
    assert learns(8192) == 2
    err = capsys.readouterr().err
    assert "vehicle.mass" in err
    assert err.startswith("race train: p.checkpoint.npz: ")
    assert err.count("\n") == 1
    assert (begun / "p.npz").read_bytes() == before
    (begun / "v.yaml").write_text(text)
    assert learns(8192) == 0
    assert steps_of("p.npz") == 8192


@pytest.mark.parametrize(
    ("flags", "name"),
    [(["--crash", "3"], "rewards.crash"), (["--time-limit", "5"], "time_limit")],
)
def test_a_training_with_other_rewards_is_another_one(begun, capsys, flags, name):
    assert learns(8192, *flags) == 2
    assert f"same {name}: " in capsys.readouterr().err


def test_a_pilot_knows_the_numbers_of_its_vehicle(begun):
    first = load_pilot("p.npz").about
    with_other_mass(begun)
    assert learns(4096, out="q.npz") == 0
    second = load_pilot("q.npz").about
    assert first.vehicle == second.vehicle == "v"
    assert len(first.vehicle_sha256) == 64
    assert first.vehicle_sha256 != second.vehicle_sha256


def test_a_training_killed_before_its_checkpoint_keeps_the_better_pilot(begun):
    """The pilot on the disk is newer than the checkpoint, and better than what comes."""
    pilot = load_pilot("p.npz")
    best = row(8192, finished=1.0, lap=0.5, gates=1.0)
    about = structs.replace(pilot.about, training=pilot.about.training | {"evaluated": best})
    (begun / "p.npz").write_bytes(pilot_bytes(pilot.weights, about))
    assert learns(12288) == 0
    assert load_pilot("p.npz").about.training["evaluated"] == best


def test_a_training_whose_pilot_is_gone_writes_one_again(begun):
    (begun / "p.npz").unlink()
    assert learns(8192) == 0
    assert steps_of("p.npz") == 8192


def test_a_training_replaces_no_file_that_is_no_pilot(place, capsys):
    (place / "p.npz").write_bytes(b"something else")
    assert learns(4096) == 2
    assert capsys.readouterr().err.startswith("race train: p.npz: expected a pilot")
    assert (place / "p.npz").read_bytes() == b"something else"


def test_a_training_that_cannot_write_says_so_before_it_learns(place, capsys):
    assert learns(4096, out="/proc/x/p.npz") == 2
    err = capsys.readouterr().err
    assert err.startswith("race train: /proc/x: cannot write here")
    assert err.count("\n") == 1


class Ticking:
    """A clock that goes on by a tenth of a second with each look at it."""

    def __init__(self):
        self._looks = count()

    def __call__(self):
        return 0.1 * next(self._looks)


def test_a_training_of_some_minutes_ends_with_its_pilot_and_continues(place, monkeypatch, capsys):
    monkeypatch.setattr(training_module, "perf_counter", Ticking())
    steps = 10**12
    assert learns(steps, "--minutes", "0.05", "--json") == 0
    first = json.loads(capsys.readouterr().out)["history"]
    assert first[-1]["steps"] < steps
    assert first[-1]["seconds"] >= 0.05 * 60
    assert load_pilot("p.npz").about.training["steps"] <= first[-1]["steps"]
    more = first[-1]["seconds"] / 60 + 0.025
    assert learns(steps, "--minutes", str(more), "--json") == 0
    history = json.loads(capsys.readouterr().out)["history"]
    assert history[: len(first)] == first
    assert len(history) > len(first)


def test_the_learning_rate_follows_the_steps_or_the_time_whichever_is_further(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(training_module, "perf_counter", lambda: now[0])
    asked = Training(None, CONFIG, seed=0, steps=1000, out=Path("p.npz"), minutes=1.0)
    clock = Clock(asked, steps=100, seconds=6.0)
    assert clock.share(100) == pytest.approx(0.1)
    now[0] = 24.0
    assert clock.share(100) == pytest.approx(0.5)
    assert clock.share(700) == pytest.approx(0.7)
    assert clock.progress(700) == pytest.approx((700, 0.7, 25.0, 12.0))
    rates = [learning_rate(share, CONFIG) for share in (0.0, 0.5, 1.0, 1.1)]
    middle = (CONFIG.first_rate + CONFIG.last_rate) / 2
    ends = (CONFIG.first_rate, CONFIG.last_rate)
    assert rates == pytest.approx([ends[0], middle, ends[1], ends[1]])


def test_progress_is_a_line_with_steps_speed_and_time_left():
    text = progress_text(Progress(12_340_000, 0.25, 64_200.0, 3723.4), 200_000_000)
    assert text == "12.3 of 200.0 M steps, 64 k/s, 1:02:03 left"


def test_without_a_terminal_every_evaluation_is_a_line(place, capsys):
    assert learns(8192) == 0
    err = capsys.readouterr().err
    assert err.count("\n") == err.count("M steps: reward") >= 2
    assert "\x1b" not in err


def test_on_a_terminal_the_line_moves_and_evaluations_stay(place, capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    assert learns(8192) == 0
    err = capsys.readouterr().err
    assert "\x1b[2K" in err
    assert "M steps: reward" in err
    assert "k/s" in err


@pytest.mark.regression
def test_a_training_writes_a_pilot_that_flies_and_goes_on_from_its_checkpoint(tmp_path, capsys):
    pytest.importorskip("stable_baselines3")
    out = tmp_path / "p.npz"
    assert trains("split_s_swift", 16384, "--out", str(out), "--json") == 0
    first = json.loads(capsys.readouterr().out)["history"]
    assert first[-1]["steps"] == 16384
    assert load_pilot(out).about.training["seed"] == 0
    assert out.with_suffix(".png").stat().st_size > 1000
    assert trains("split_s_swift", 32768, "--out", str(out), "--json") == 0
    history = json.loads(capsys.readouterr().out)["history"]
    assert history[: len(first)] == first
    assert history[-1]["steps"] == 32768
    assert trains("split_s_swift", 65536, "--seed", "1", "--out", str(out)) == 2
    assert "same seed" in capsys.readouterr().err


@pytest.mark.regression
def test_a_folder_of_courses_is_learnt_in_environments_of_64_each(tmp_path, monkeypatch):
    pytest.importorskip("stable_baselines3")
    monkeypatch.chdir(tmp_path)
    assert race(["courses", "--generate", "2", "--seed", "3", "--out", "some"]) == 0
    assert trains("some", 16384, "--out", "p.npz") == 0
    assert load_pilot(tmp_path / "p.npz").about.course == "random_3_1, random_3_2"
