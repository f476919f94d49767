"""Learning: gradients are those of the loss, advantages those of their definition, a training goes
on where it was."""

import json

import numpy as np
import pytest

from controllers.learned.network import Adam, activations, forward, gradient, new
from controllers.learned.pilot import load_pilot
from quadsim.cli.cli import race
from quadsim.learn.ppo import PPO, PPOConfig, gae
from quadsim.learn.task import task


def test_the_gradient_is_that_of_finite_differences():
    rng = np.random.default_rng(0)
    w = [a.astype(float) for a in new((3, 5, 4, 2), rng, last=1.0)]
    x, weight = rng.normal(size=(7, 3)), rng.normal(size=(7, 2))
    g = gradient(w, activations(w, x.copy()), weight.copy())
    for a, da in zip(w, g, strict=True):
        at = tuple(rng.integers(a.shape))
        a[at] += 1e-6
        above = (forward(w, x) * weight).sum()
        a[at] -= 2e-6
        below = (forward(w, x) * weight).sum()
        a[at] += 1e-6
        assert da[at] == pytest.approx((above - below) / 2e-6, rel=1e-5, abs=1e-8)


def test_adam_finds_the_least_of_a_quadratic():
    w = [np.array([3.0, -2.0], np.float32)]
    adam = Adam(w, most=10.0)
    for _ in range(500):
        adam.step(w, [2 * (w[0] - 1)], 0.05)
    np.testing.assert_allclose(w[0], 1.0, atol=0.02)


def test_advantages_follow_their_sum():
    rng = np.random.default_rng(1)
    reward, value, ahead = (rng.normal(size=(6, 1)) for _ in range(3))
    ended, cut = np.zeros((6, 1), bool), np.zeros((6, 1), bool)
    ended[2], cut[4] = True, True
    delta = (reward + 0.9 * ahead * ~ended - value)[:, 0]
    c = 0.9 * 0.8
    expected = [delta[0] + c * delta[1] + c * c * delta[2], delta[1] + c * delta[2], delta[2]]
    expected += [delta[3] + c * delta[4], delta[4], delta[5]]
    np.testing.assert_allclose(gae(reward, value, ahead, ended, cut, 0.9, 0.8)[:, 0], expected)


def test_a_crash_counts_wholly_only_where_a_policy_flies():
    config = PPOConfig(environments=16, hidden=8, steps=2, first_crash=0.5, crash_grows=(1.0, 3.0))
    ppo = PPO(task("split_s_swift", reward={"crash": 10.0}), config)
    for reward, weight in ((0.0, 5.0), (2.0, 7.5), (9.0, 10.0), (-1.0, 5.0)):
        ppo.reward = reward
        assert ppo.learn()["reward"] == ppo.reward
        assert ppo.envs.rewards.crash == weight


def test_a_training_writes_a_pilot_that_flies_and_goes_on_from_its_checkpoint(tmp_path, capsys):
    out = tmp_path / "p.npz"
    words = [
        "train",
        "split_s_swift",
        "--laps",
        "1",
        "--environments",
        "16",
        "--hidden",
        "8",
        "--flights",
        "1",
    ]
    assert race([*words, "--steps", "2048", "--out", str(out), "--json"]) == 0
    first = json.loads(capsys.readouterr().out)["history"]
    assert first[-1]["steps"] == 2048
    assert load_pilot(out).about.training["seed"] == 0
    assert out.with_suffix(".png").stat().st_size > 1000
    assert race([*words, "--steps", "4096", "--out", str(out), "--json"]) == 0
    history = json.loads(capsys.readouterr().out)["history"]
    assert history[: len(first)] == first
    assert history[-1]["steps"] == 4096
    assert race([*words, "--steps", "8192", "--seed", "1", "--out", str(out)]) == 2
    assert "expected a training of the same seed" in capsys.readouterr().err


def test_a_folder_of_courses_is_learnt_in_environments_of_64_each(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert race(["courses", "--generate", "2", "--seed", "3", "--out", "some"]) == 0
    words = [
        "train",
        "some",
        "--environments",
        "128",
        "--hidden",
        "8",
        "--flights",
        "2",
        "--laps",
        "1",
    ]
    assert race([*words, "--steps", "8192", "--out", "p.npz"]) == 0
    assert load_pilot(tmp_path / "p.npz").about.course == "random_3_1, random_3_2"
