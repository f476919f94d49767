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


@pytest.mark.compiled
@pytest.mark.parametrize("kind", KINDS)
def test_a_wrong_seed_names_the_range_and_changes_nothing(kind):
    env = made(kind)
    env.reset(seed=1)
    first = rollout(env, steps=5)
    env.reset(seed=1)
    for seed in (2**70, 2**63, -1, 1.5, NAN, "3", True, [1]):
        text = refused("seed", env.reset, seed=seed)
        assert "expected a whole number >= 0 and <= 9.22337e+18" in text, seed
    assert rollout(env, steps=5) == first


@pytest.mark.compiled
@pytest.mark.parametrize("kind", KINDS)
def test_every_seed_of_the_range_serves(kind):
    env = made(kind, randomize=0.5)
    found = []
    for seed in (np.int64(3), 2**32 - 1, 2**63 - 1):
        env.reset(seed=seed)
        found.append(rollout(env, steps=5))
        env.reset(seed=seed)
        assert rollout(env, steps=5) == found[-1], seed
    assert len(set(found)) == 3


@pytest.mark.parametrize("kind", KINDS)
def test_options_are_a_dict(kind):
    assert "expected a dict or None, got 3" in refused("options", made(kind).reset, options=3)


def test_a_weight_of_the_reward_is_a_finite_number():
    for weight in (NAN, float("inf"), "x", "3", None, True, 10**400, -1e300):
        for kind in KINDS:
            text = refused("reward.crash", made, kind, reward={"crash": weight})
            assert "expected a number >= -1e+06 and <= 1e+06, got" in text, (kind, weight)
        refused("crash", RewardWeights, crash=weight)


def test_a_reward_has_the_terms_of_the_reward():
    for reward in ({"bogus": 1}, {3: 1}, 3, "x", [1]):
        text = refused("reward", made, RacingEnv, reward=reward)
        assert "expected RewardWeights or weights of progress" in text, reward


def test_threads_are_a_whole_number_of_this_machine():
    for value in ("2", 1.5, 0, -1, True, 10**6, [1]):
        assert "expected 1 to" in refused("threads", made, RacingVectorEnv, threads=value), value


def test_a_number_of_environments_is_a_whole_number():
    for value in (0, -1, True, "3", 1.5, None):
        text = refused("num_envs", made, RacingVectorEnv, num_envs=value)
        assert "expected a whole number >= 1, got" in text, value


def test_more_environments_than_the_memory_holds_are_refused():
    for value in (10**12, 2**70):
        text = refused("num_envs", made, RacingVectorEnv, num_envs=value)
        assert f"as each needs {BYTES} bytes of the free memory, got {value}" in text


@pytest.mark.compiled
def test_an_environment_needs_about_the_memory_that_the_error_names():
    n = 4096
    env = made(RacingVectorEnv, num_envs=n)
    env.reset(seed=0)
    lanes = env.lanes
    held = sum(array.nbytes for array in (*lanes.episodes, *lanes._outcome))
    assert BYTES / 3 < held / n < BYTES
    assert 10**6 < free_memory() < 10**15


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["laps", "start", "noise", "time_limit", "dt", "randomize"])
def test_a_wrong_setting_names_itself(kind, name):
    for value in ("x", "0.01", NAN, -1, True, [], 10**400, np.zeros(2)):
        assert f"{name}: expected" in refused(name, made, kind, **{name: value}), value


@pytest.mark.slow
def test_none_is_the_default_of_a_setting():
    usual = made(RacingEnv).task
    for name in ("laps", "start", "noise", "time_limit", "dt", "randomize"):
        assert made(RacingEnv, **{name: None}).task == usual, name


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["viewer", "render_mode", "bogus"])
def test_a_wrong_view_or_name_is_one_line(kind, name):
    refused(name, made, kind, **{name: 3})


@pytest.mark.compiled
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.filterwarnings("error")
def test_an_action_of_another_dtype_is_refused(kind):
    env = made(kind)
    env.reset(seed=0)
    shape = env.action_space.shape
    for dtype in (complex, "U1", object, "datetime64[s]"):
        with pytest.raises(
            ValueError, match=r"action: expected numbers in -1\.\.1 of shape .*, got"
        ):
            env.step(np.zeros(shape, dtype))
    with pytest.raises(ValueError, match=r"action\[0.*\]: expected a finite number .* got inf"):
        env.step(np.full(shape, 1e300))


@pytest.mark.compiled
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


def flown_anew(env):
    """Return a hash of an episode from its beginning."""
    env.reset(seed=1)
    return rollout(env)


def _fly_in_child(env, sender):
    sender.send(flown_anew(env))


@pytest.mark.process
@pytest.mark.compiled
def test_a_forked_process_flies_to_the_last_bit():
    """A fork has none of its parent's threads, and starts its own."""
    env = made(RacingVectorEnv, num_envs=70)
    flown = flown_anew(env)
    fork = multiprocessing.get_context("fork")
    receiver, sender = fork.Pipe()
    child = fork.Process(target=_fly_in_child, args=(env, sender))
    child.start()
    assert receiver.poll(120), "the child has ended without a result"
    found = receiver.recv()
    child.join()
    assert child.exitcode == 0
    assert found == flown


@pytest.mark.process
@pytest.mark.compiled
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


@pytest.mark.compiled
def test_the_loops_of_a_copy_are_those_of_the_task():
    lanes = LaneEnvironments(made(RacingEnv).task, 3)
    lanes.begin(0)
    other = copy.deepcopy(lanes)
    other.step(np.zeros((1, 4, 64), np.float32))
    assert other.steps.any()
    assert not lanes.steps.any()
