"""stable-baselines3's way to hold many environments: the same flights under its rules."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rl is not installed")
pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not installed")

import gymnasium
from stable_baselines3.common.env_checker import check_env

from quadsim.learn.stable_baselines import RacingVecEnv
from quadsim.learn.vector_env import RacingVectorEnv

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


@pytest.mark.parametrize("env_id", ["quadsim/Racing-v0", "quadsim/RacingBullet-v0"])
@pytest.mark.filterwarnings("error")
def test_the_check_of_stable_baselines_passes(env_id):
    env = gymnasium.make(f"quadsim.learn:{env_id}", randomize=0.5)
    check_env(env.unwrapped)
    env.close()
