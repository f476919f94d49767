"""stable-baselines3's way to hold many environments: the same flights under its rules."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rl is not installed")
pytest.importorskip("stable_baselines3", reason="the extra train is not installed")

import gymnasium
from stable_baselines3.common.env_checker import check_env

from quadsim.controllers.learned.pilot import load_pilot
from quadsim.learn.ppo import EndlessRaces, Learner
from quadsim.learn.ppo_config import PPOConfig
from quadsim.learn.stable_baselines import RacingVecEnv
from quadsim.learn.starts import hover_action
from quadsim.learn.task import task
from quadsim.learn.training import Training, pilot_of
from quadsim.learn.vector_env import RacingVectorEnv

# PyTorch is large: `make regression` is run where it is installed.
pytestmark = pytest.mark.regression

N = 70
SETTINGS = {"start": "anywhere", "randomize": 0.5}
ACTIONS = np.random.default_rng(0).normal(0, 0.3, (150, N, 4)).astype(np.float32)


@pytest.mark.parametrize("hold", [1, 2])
def test_stable_baselines_sees_the_same_flights_and_where_they_ended(hold):
    envs = RacingVectorEnv(N, autoreset_mode="SameStep", **SETTINGS)
    first, _ = envs.reset(seed=5)
    adapted = RacingVecEnv(N, hold=hold, **SETTINGS)
    adapted.seed(5)
    np.testing.assert_array_equal(adapted.reset(), first)
    ends = 0
    for actions in ACTIONS:
        obs, reward, done, infos = adapted.step(actions)
        expected_reward = np.zeros(N, np.float32)
        ended_before = np.zeros(N, bool)
        for _ in range(hold):
            expected, rewards, ended, cut, info = envs.step(actions)
            expected_reward += np.where(ended_before, 0.0, rewards)
            for i in np.flatnonzero((ended | cut) & ~ended_before):
                final = info["final_obs"][i]
                np.testing.assert_array_equal(infos[i]["terminal_observation"], final)
                assert infos[i]["TimeLimit.truncated"] == cut[i]
                assert infos[i]["crashed"] == info["crashed"][i]
            ended_before |= ended | cut
        np.testing.assert_array_equal(obs, expected)
        np.testing.assert_array_equal(reward, expected_reward)
        np.testing.assert_array_equal(done, ended_before)
        assert [bool(info) for info in infos] == done.tolist()
        ends += done.sum()
    assert ends > 10


def test_settings_are_those_of_all_environments():
    from stable_baselines3.common.vec_env import VecMonitor

    adapted = RacingVecEnv(8, **SETTINGS)
    assert adapted.get_attr("num_envs") == [8] * 8
    assert adapted.env_is_wrapped(VecMonitor, indices=[0, 1]) == [False, False]
    with pytest.raises(ValueError, match="x:"):
        adapted.set_attr("x", 1, indices=0)


def test_a_learner_hovers_at_first_and_its_pilot_does_what_its_policy_means(tmp_path):
    import torch

    asked = task("split_s_swift", start="anywhere", time_limit=10.0)
    config = PPOConfig(environments=64, hidden=8, steps=8)
    learner = Learner(asked, config, seed=0)
    before = learner.parameters()
    hover = hover_action(asked.vehicle, asked.dt)
    np.testing.assert_allclose(learner.pilot_weights()[-1], hover, rtol=1e-6)
    learner.learn()
    assert learner.steps_done == 64 * 8 * config.hold
    after = learner.parameters()
    assert any((before[name] != after[name]).any() for name in before)

    pilot = pilot_of(learner, Training(asked, config, 0, 1, tmp_path / "p.npz"))
    obs = np.random.default_rng(0).normal(size=(5, 38)).astype(np.float32)
    distribution = learner._model.policy.get_distribution(torch.from_numpy(obs))
    mean = distribution.mode().detach().numpy()
    np.testing.assert_allclose(pilot(obs), np.clip(mean, -1, 1), rtol=1e-5, atol=1e-6)


def test_a_learner_that_is_restored_has_the_same_numbers():
    asked = task("split_s_swift", start="anywhere", time_limit=10.0)
    config = PPOConfig(environments=64, hidden=8, steps=8)
    first, second = (Learner(asked, config, seed) for seed in (0, 1))
    second.restore(first.parameters(), steps_done=12)
    assert second.steps_done == 12
    for name, array in first.parameters().items():
        np.testing.assert_array_equal(second.parameters()[name], array)


def test_the_finish_of_a_race_around_a_loop_is_a_cut_and_a_crash_is_none():
    asked = task("split_s_swift", start="anywhere", laps=1, time_limit=10.0)
    envs = EndlessRaces(N, asked, hold=2, scale=0.05)
    envs.seed(0)
    obs = envs.reset()
    pilot = load_pilot("split_s_swift")
    finishes, crashes = [], []
    for step in range(200):
        # some of them crash
        actions = np.where(np.arange(N)[:, None] < step, 1.0, pilot(obs))
        obs, _, done, infos = envs.step(actions)
        for info in (infos[i] for i in np.flatnonzero(done)):
            cut = info["TimeLimit.truncated"]
            (finishes if info["finished"] else crashes).append(cut)
    assert len(finishes) > 5
    assert all(finishes)
    assert len(crashes) > 5
    assert not any(crashes)


@pytest.mark.parametrize("env_id", ["quadsim/Racing-v0", "quadsim/RacingBullet-v0"])
@pytest.mark.filterwarnings("error")
def test_the_check_of_stable_baselines_passes(env_id):
    env = gymnasium.make(f"quadsim.learn:{env_id}", randomize=0.5)
    check_env(env.unwrapped)
    env.close()
