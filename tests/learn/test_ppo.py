"""The learner: what it begins with, what its pilot does, and what it keeps."""

import numpy as np

from controllers.learned.pilot import forward
from quadsim.learn.ppo import Learner
from quadsim.learn.ppo_config import PPOConfig
from quadsim.learn.starts import hover_action
from quadsim.learn.task import task
from quadsim.learn.training import Training, pilot_of

CONFIG = PPOConfig(environments=64, hidden=8, steps=8)


def learner_of(seed):
    """Return a small learner."""
    asked = task("split_s_swift", start="anywhere", time_limit=10.0)
    return Learner(asked, CONFIG, seed)


def test_a_learner_hovers_at_first_and_its_pilot_flies_its_mean(tmp_path):
    learner = learner_of(0)
    before = learner.parameters()
    hover = hover_action(learner.task.vehicle, learner.task.dt)
    np.testing.assert_allclose(learner.pilot_weights()[-1], hover, rtol=1e-6)
    learner.learn()
    assert learner.steps_done == 64 * 8 * CONFIG.hold
    after = learner.parameters()
    assert any((before[name] != after[name]).any() for name in before)

    pilot = pilot_of(learner, Training(learner.task, CONFIG, 0, 1, tmp_path / "p.npz"))
    obs = np.random.default_rng(0).normal(size=(5, 38)).astype(np.float32)
    mean = forward(learner.pilot_weights(), obs, "relu")
    np.testing.assert_array_equal(pilot(obs), np.clip(mean, -1, 1))


def test_the_same_seed_learns_the_same():
    first, second, other = learner_of(0), learner_of(0), learner_of(1)
    rewards = [learner.learn() for learner in (first, second, other)]
    assert rewards[0] == rewards[1] != rewards[2]
    for name, array in first.parameters().items():
        np.testing.assert_array_equal(second.parameters()[name], array)


def test_a_learner_that_is_restored_has_the_same_numbers():
    first, second = learner_of(0), learner_of(1)
    first.learn()
    second.restore(first.parameters(), first.steps_done)
    assert second.steps_done == first.steps_done
    for name, array in first.parameters().items():
        np.testing.assert_array_equal(second.parameters()[name], array)
