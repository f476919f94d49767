"""Training: a pilot is written, and a training goes on where it was."""

import json

import numpy as np
import pytest

from controllers.learned.pilot import load_pilot
from quadsim.cli.cli import race
from quadsim.files.strict_yaml import FileError
from quadsim.learn.checkpoint import Checkpoint, checkpoint_bytes, read_checkpoint
from quadsim.learn.ppo_config import PPOConfig, crash_share
from quadsim.learn.training import Score

NETWORK = {
    "weight": np.arange(6, dtype=np.float32).reshape(2, 3),
    "bias": np.zeros(3, np.float32),
}


def trains(course, steps, *flags):
    """Train with sizes that take seconds."""
    sizes = ["--laps", "1", "--environments", "128", "--hidden", "8", "--flights", "1"]
    return race(["train", course, *sizes, "--steps", str(steps), *flags])


def test_a_crash_counts_wholly_only_where_a_policy_flies():
    config = PPOConfig(first_crash=0.5, crash_grows=(1.0, 3.0))
    shares = [crash_share(reward, config) for reward in (-1.0, 1.0, 2.0, 3.0, 9.0)]
    assert shares == [0.5, 0.5, 0.75, 1.0, 1.0]


def test_a_pilot_that_finishes_is_better_than_a_fast_one_that_does_not():
    half = Score.of({"finished": 0.5, "lap": 5.0, "gates": 0.9})
    slow = Score.of({"finished": 1.0, "lap": 9.0, "gates": 1.0})
    fast = Score.of({"finished": 1.0, "lap": 8.0, "gates": 1.0})
    none = Score.of({"finished": 0.0, "lap": 0.0, "gates": 0.9})
    assert sorted([fast, none, slow, half]) == [none, half, slow, fast]


def test_a_checkpoint_is_read_as_it_was_written(tmp_path):
    path = tmp_path / "p.checkpoint.npz"
    history = [{"steps": 10, "reward": 1.5}]
    path.write_bytes(checkpoint_bytes(Checkpoint(NETWORK, 10, history), {"laps": (1, 2)}))
    found = read_checkpoint(path, NETWORK, {"laps": (1, 2)})
    assert found.history == history
    assert found.steps_done == 10
    for name, array in NETWORK.items():
        np.testing.assert_array_equal(found.parameters[name], array)


@pytest.mark.parametrize(
    ("network", "identity", "problem"),
    [
        (NETWORK, {"seed": 1}, "same seed"),
        (NETWORK | {"bias": np.zeros(4, np.float32)}, {"seed": 0}, "bias"),
        (NETWORK | {"more": np.zeros(4, np.float32)}, {"seed": 0}, "more"),
    ],
)
def test_a_checkpoint_of_another_training_is_refused(tmp_path, network, identity, problem):
    path = tmp_path / "p.checkpoint.npz"
    path.write_bytes(checkpoint_bytes(Checkpoint(NETWORK, 10, []), {"seed": 0}))
    with pytest.raises(FileError, match=problem):
        read_checkpoint(path, network, identity)


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


def test_a_folder_of_courses_is_learnt_in_environments_of_64_each(tmp_path, monkeypatch):
    pytest.importorskip("stable_baselines3")
    monkeypatch.chdir(tmp_path)
    assert race(["courses", "--generate", "2", "--seed", "3", "--out", "some"]) == 0
    assert trains("some", 16384, "--out", "p.npz") == 0
    assert load_pilot(tmp_path / "p.npz").about.course == "random_3_1, random_3_2"
