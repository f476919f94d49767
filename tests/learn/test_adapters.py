"""Other libraries' ways to hold many environments: same flights, their rules. Run where those
libraries are."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rl is not installed")

from quadsim.learn.vector_env import RacingVectorEnv

N, SETTINGS = 70, {"start": "anywhere", "randomize": 0.5}
ACTIONS = np.random.default_rng(0).normal(0, 0.3, (150, N, 4)).astype(np.float32)


@pytest.fixture
def envs():
    """What the adapters adapt, from the same seed."""
    found = RacingVectorEnv(N, autoreset_mode="SameStep", **SETTINGS)
    found.first = found.reset(seed=5)[0]
    return found


def test_stable_baselines_sees_the_same_flights_and_where_they_ended(envs):
    pytest.importorskip("stable_baselines3")
    from quadsim.learn.stable_baselines import RacingVecEnv

    adapted = RacingVecEnv(N, **SETTINGS)
    adapted.seed(5)
    np.testing.assert_array_equal(adapted.reset(), envs.first)
    ends = 0
    for actions in ACTIONS:
        obs, reward, done, infos = adapted.step(actions)
        expected, rewards, ended, cut, told = envs.step(actions)
        np.testing.assert_array_equal(obs, expected)
        np.testing.assert_array_equal(reward, rewards)
        np.testing.assert_array_equal(done, ended | cut)
        assert [bool(info) for info in infos] == done.tolist()
        for i in np.flatnonzero(done):
            np.testing.assert_array_equal(infos[i]["terminal_observation"], told["final_obs"][i])
            assert infos[i]["TimeLimit.truncated"] == cut[i]
            assert infos[i]["crashed"] == told["crashed"][i]
        ends += done.sum()
    assert ends > 10


def test_stable_baselines_learns_in_it():
    sb3 = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecMonitor

    from quadsim.learn.stable_baselines import RacingVecEnv

    adapted = RacingVecEnv(8, **SETTINGS)
    assert adapted.get_attr("num_envs") == [8] * 8
    assert adapted.env_is_wrapped(VecMonitor, indices=[0, 1]) == [False, False]
    with pytest.raises(ValueError, match="for all 8 environments at once"):
        adapted.set_attr("x", 1, indices=0)
    model = sb3.PPO(
        "MlpPolicy",
        VecMonitor(adapted),
        n_steps=16,
        batch_size=64,
        n_epochs=1,
        device="cpu",
        seed=0,
    )
    before = [p.detach().clone() for p in model.policy.parameters()]
    model.learn(256)
    assert any((a != b).any() for a, b in zip(before, model.policy.parameters(), strict=True))


def test_tensors_are_the_arrays_themselves(envs, monkeypatch):
    torch = pytest.importorskip("torch")
    from quadsim.learn.tensors import RacingTensors

    adapted = RacingTensors(N, **SETTINGS)
    given, rows = [], adapted.envs._rows
    monkeypatch.setattr(adapted.envs, "_rows", lambda lanes: given.append(rows(lanes)) or given[-1])
    obs = adapted.reset(seed=5)
    np.testing.assert_array_equal(obs.numpy(), envs.first)
    assert obs.data_ptr() == given[-1].ctypes.data
    for actions in ACTIONS[:50]:
        *found, info = adapted.step(torch.from_numpy(actions).requires_grad_())
        *expected, told = envs.step(actions)
        for tensor, array in zip(found, expected, strict=True):
            np.testing.assert_array_equal(tensor.numpy(), array)
        assert set(info) == set(told)
