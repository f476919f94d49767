"""Environments that are misused: each error is one line, and the environment is as before it."""

import copy
import hashlib
import multiprocessing
import pickle
from functools import partial

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the extra rl is not installed")

from quadsim.files.values import SettingError  # noqa: E402
from quadsim.learn.bullet_env import RacingBulletEnv  # noqa: E402
from quadsim.learn.lanes import LaneEnvironments  # noqa: E402
from quadsim.learn.reward import RewardWeights  # noqa: E402
from quadsim.learn.single_env import RacingEnv  # noqa: E402
from quadsim.learn.vector_env import BYTES, RacingVectorEnv, free_memory  # noqa: E402

NAN = float("nan")
KINDS = (RacingEnv, RacingVectorEnv, RacingBulletEnv)


def made(kind, **settings):
    plant = {"plant": "rigid"} if kind is RacingBulletEnv else {}
    count = {"num_envs": 3} if kind is RacingVectorEnv else {}
    return kind(**{"course": "figure8"} | plant | count | settings)


def refused(name, call, *arguments, **settings):
    """Return the text of the one line with which a call is refused."""
    with pytest.raises(SettingError) as error:
        call(*arguments, **settings)
    assert error.value.name == name
    assert "\n" not in str(error.value)
    return str(error.value)


def rollout(env, steps=20):
    """Return a hash of everything that some steps give."""
    rng = np.random.default_rng(0)
    digest = hashlib.sha256()
    for _ in range(steps):
        action = rng.normal(0, 0.1, env.action_space.shape).astype(np.float32)
        obs, reward, *_ = env.step(action)
        digest.update(obs.tobytes() + np.asarray(reward).tobytes())
    return digest.hexdigest()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [2**70, 2**63, -1, 1.5, NAN, "3", True, [1]])
def test_a_wrong_seed_names_the_range_and_changes_nothing(kind, seed):
    env = made(kind)
    text = refused("seed", env.reset, seed=seed)
    assert "expected a whole number >= 0 and <= 9.22337e+18" in text
    env.reset(seed=1)
    first = rollout(env)
    env.reset(seed=1)
    refused("seed", env.reset, seed=seed)
    assert rollout(env) == first


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", [np.int64(3), 2**32 - 1, 2**63 - 1])
def test_every_seed_of_the_range_serves(kind, seed):
    env = made(kind, randomize=0.5)
    env.reset(seed=seed)
    once = rollout(env)
    env.reset(seed=seed)
    assert rollout(env) == once


@pytest.mark.parametrize("kind", KINDS)
def test_options_are_a_dict(kind):
    assert "expected a dict or None, got 3" in refused("options", made(kind).reset, options=3)


@pytest.mark.parametrize("weight", [NAN, float("inf"), "x", "3", None, True, 10**400, -1e300])
def test_a_weight_of_the_reward_is_a_finite_number(weight):
    for kind in KINDS:
        text = refused("reward.crash", made, kind, reward={"crash": weight})
        assert "expected a number >= -1e+06 and <= 1e+06, got" in text
    refused("crash", RewardWeights, crash=weight)


@pytest.mark.parametrize("reward", [{"bogus": 1}, {3: 1}, 3, "x", [1]])
def test_a_reward_has_the_terms_of_the_reward(reward):
    assert "expected RewardWeights or weights of progress" in refused(
        "reward", made, RacingEnv, reward=reward
    )


@pytest.mark.parametrize("value", ["2", 1.5, 0, -1, True, 10**6, [1]])
def test_threads_are_a_whole_number_of_this_machine(value):
    text = refused("threads", made, RacingVectorEnv, threads=value)
    assert "expected 1 to" in text


@pytest.mark.parametrize("value", [0, -1, True, "3", 1.5, None])
def test_a_number_of_environments_is_a_whole_number(value):
    text = refused("num_envs", made, RacingVectorEnv, num_envs=value)
    assert "expected a whole number >= 1, got" in text


@pytest.mark.parametrize("value", [10**12, 2**70])
def test_more_environments_than_the_memory_holds_are_refused(value):
    text = refused("num_envs", made, RacingVectorEnv, num_envs=value)
    assert f"as each needs {BYTES} bytes of the free memory, got {value}" in text


def test_an_environment_needs_about_the_memory_that_the_error_names():
    n = 4096
    env = made(RacingVectorEnv, num_envs=n)
    env.reset(seed=0)
    lanes = env.lanes
    held = sum(array.nbytes for array in (*lanes.episodes, *lanes._outcome))
    assert BYTES / 3 < held / n < BYTES
    assert 10**6 < free_memory() < 10**15


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["laps", "start", "noise", "time_limit", "dt", "randomize"])
@pytest.mark.parametrize("value", ["x", "0.01", NAN, -1, True, [], 10**400, np.zeros(2)])
def test_a_wrong_setting_names_itself(kind, name, value):
    assert f"{name}: expected" in refused(name, made, kind, **{name: value})


@pytest.mark.parametrize("name", ["laps", "start", "noise", "time_limit", "dt", "randomize"])
def test_none_is_the_default_of_a_setting(name):
    assert made(RacingEnv, **{name: None}).task == made(RacingEnv).task


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("name", "value"), [("viewer", 3), ("render_mode", 3), ("bogus", 3)])
def test_a_wrong_view_or_name_is_one_line(kind, name, value):
    refused(name, made, kind, **{name: value})


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dtype", [complex, "U1", object, "datetime64[s]"])
@pytest.mark.filterwarnings("error")
def test_an_action_of_another_dtype_is_refused(kind, dtype):
    env = made(kind)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"action: expected numbers in -1\.\.1 of shape .*, got"):
        env.step(np.zeros(env.action_space.shape, dtype))
    with pytest.raises(ValueError, match=r"action\[0.*\]: expected a finite number .* got inf"):
        env.step(np.full(env.action_space.shape, 1e300))


@pytest.mark.parametrize("kind", [RacingEnv, RacingVectorEnv])
@pytest.mark.parametrize("way", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_continues_the_episode_and_leaves_the_first_alone(kind, way):
    env = made(kind, randomize=0.5)
    env.reset(seed=1)
    rollout(env)
    other = way(env)
    assert rollout(other) == rollout(env)
    assert type(other).__name__ == type(env).__name__


@pytest.mark.parametrize("way", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_of_the_simulated_race_stands_before_its_reset(way):
    env = made(RacingBulletEnv, randomize=0.5)
    env.reset(seed=1)
    other = way(env)
    with pytest.raises(gymnasium.error.ResetNeeded):
        other.step(np.zeros(4))
    other.reset(seed=1)
    assert rollout(other) == rollout(env)


def _roll_in_child(env, sender):
    sender.send(rollout(env))


def test_a_forked_process_flies_on_one_thread_to_the_last_bit():
    """A fork has none of its parent's threads; OpenMP ended the process that asked for them."""
    env = made(RacingVectorEnv, num_envs=70)
    env.reset(seed=1)
    rollout(env)
    fork = multiprocessing.get_context("fork")
    receiver, sender = fork.Pipe()
    child = fork.Process(target=_roll_in_child, args=(env, sender))
    child.start()
    assert receiver.poll(120), "the child has ended without a result"
    found = receiver.recv()
    child.join()
    assert child.exitcode == 0
    assert found == rollout(env)


def test_gymnasiums_processes_fly_by_fork_after_a_rollout():
    env = made(RacingEnv)
    env.reset(seed=1)
    expected = rollout(env, steps=3)
    makers = [partial(RacingEnv, course="figure8")] * 2
    envs = gymnasium.vector.AsyncVectorEnv(makers, context="fork")
    envs.reset(seed=[1, 2])
    rng = np.random.default_rng(0)
    digest = hashlib.sha256()
    for _ in range(3):
        action = rng.normal(0, 0.1, 4).astype(np.float32)
        obs, rewards, *_ = envs.step(np.tile(action, (2, 1)))
        digest.update(obs[0].tobytes() + np.asarray(float(rewards[0])).tobytes())
    envs.close()
    assert digest.hexdigest() == expected


def test_the_loops_of_a_copy_are_those_of_the_task():
    lanes = LaneEnvironments(made(RacingEnv).task, 3)
    lanes.begin(0)
    other = copy.deepcopy(lanes)
    other.step(np.zeros((1, 4, 64), np.float32))
    assert other.steps.any()
    assert not lanes.steps.any()
