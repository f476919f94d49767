"""Proximal Policy Optimization (PPO, Schulman et al. 2017) on the compiled environments, in numpy.

Two things are added to the algorithm. An action is held for several steps of the environment. And
where a race around a closed course ends at its finish, the value of flying on is put in the place
of nothing, as the policy does not observe which lap it flies.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from controllers.lanes.environment import SAME_STEP
from controllers.lanes.layout import LANES
from controllers.learned.observation import SIZE
from controllers.learned.pilot import ACTIONS
from quadsim.learn.lanes import LaneEnvironments
from quadsim.learn.network import Adam, Network
from quadsim.learn.ppo_config import PPOConfig
from quadsim.learn.reward import RewardParams, RewardWeights
from quadsim.learn.starts import hover_action
from quadsim.learn.task import LearningTask
from quadsim.streams import training_stream

# Rewards are scaled so that a value is of the order of one: by this, over the number of actions
# that the discount looks ahead.
VALUE_SCALE = 10.0
# Greatest length of the gradient of each network
LONGEST_GRADIENT = 1.0
# Actions whose gradient is computed at once: their layers stay in a core's cache.
AT_ONCE = 1024
POLICY_GAIN = 0.01  # of the last layer's first weights: an untrained policy does the same always
VALUE_GAIN = 1.0


class Rollout(NamedTuple):
    """Actions of all environments, and what followed.  (steps, environments) each, and more."""

    obs: np.ndarray  # (steps, environments, SIZE)
    actions: np.ndarray  # (steps, environments, 4)
    log_chance: np.ndarray  # logarithm of the density with which the policy chose the action
    rewards: np.ndarray
    done: np.ndarray  # 1 where the action ended the episode
    values: np.ndarray  # (steps + 1, environments), with the value after the last action

    @classmethod
    def empty(cls, steps: int, environments: int) -> Rollout:
        """Return the memory of a rollout."""
        shape = (steps, environments)
        return cls(
            obs=np.empty((*shape, SIZE), np.float32),
            actions=np.empty((*shape, ACTIONS), np.float32),
            log_chance=np.empty(shape, np.float32),
            rewards=np.empty(shape, np.float32),
            done=np.empty(shape, np.float32),
            values=np.empty((steps + 1, environments), np.float32),
        )


class Batch(NamedTuple):
    """What an update learns from, a row for each action."""

    obs: np.ndarray  # (rows, SIZE)
    actions: np.ndarray  # (rows, 4)
    log_chance: np.ndarray  # (rows,)
    advantages: np.ndarray  # (rows,), of mean 0 and variance 1
    returns: np.ndarray  # (rows,)


class Learner:
    """A policy and its value function with the environments they learn in.

    The policy is a normal distribution around the output of a network; its standard deviations do
    not depend on the observation.

    Args:
        task: courses, vehicle, starts and rewards.
        config: numbers of the algorithm.
        seed: seed of the environments, the weights at the start and the exploration.
    """

    def __init__(self, task: LearningTask, config: PPOConfig, seed: int):
        self.task = task
        self.config = config
        self.steps_done = 0  # of the environments
        self.rate = config.first_rate
        self._seed = seed
        self._rng = np.random.default_rng(training_stream(seed))
        hidden = (SIZE, config.hidden, config.hidden)
        self._policy = Network((*hidden, ACTIONS), POLICY_GAIN, self._rng)
        # untrained, the policy hovers
        self._policy.weights[-1][:] = hover_action(task.vehicle, task.dt)
        self._log_std = np.full(ACTIONS, config.log_std, np.float32)
        self._log_std_gradient = np.zeros(ACTIONS, np.float32)
        self._value = Network((*hidden, 1), VALUE_GAIN, self._rng)
        self._policy_steps = Adam([*self._policy.weights, self._log_std], LONGEST_GRADIENT)
        self._value_steps = Adam(self._value.weights, LONGEST_GRADIENT)

        self._lanes = LaneEnvironments(task, config.environments, seed, SAME_STEP)
        self._lanes.reward_by(scaled(task.rewards, self._scale))
        self._lanes.begin(seed)
        self._actions = np.zeros((len(self._lanes.X), ACTIONS, LANES), np.float32)
        self._rollout = Rollout.empty(config.steps, config.environments)
        loops = np.array([course.loop for course in task.courses])
        self._loops = self._used(np.repeat(loops[self._lanes.course], LANES))

    def learn(self) -> float:
        """Fly config.steps actions in every environment, then update the policy.

        Returns:
            The reward per second flown.
        """
        earned = self._fly()
        self._update()
        steps = self.config.steps * self.config.environments * self.config.hold
        self.steps_done += steps
        return earned / self._scale / (steps * self.task.dt)

    def pilot_weights(self) -> list[np.ndarray]:
        """Return matrix (inputs, outputs) and bias of each layer of the policy's mean."""
        return [array.copy() for array in self._policy.weights]

    def parameters(self) -> dict[str, np.ndarray]:
        """Return all numbers of policy, value function and optimiser by name."""
        return {name: array.copy() for name, array in self._arrays().items()}

    def restore(self, parameters: Mapping[str, np.ndarray], steps_done: int) -> None:
        """Continue from these parameters, after this number of steps, in new episodes."""
        for name, array in self._arrays().items():
            array[:] = parameters[name]
        self.steps_done = steps_done
        config = self.config
        actions = config.steps * config.environments
        updates = steps_done // (actions * config.hold)
        minibatches = -(-actions // config.minibatch)
        for adam in (self._policy_steps, self._value_steps):
            adam.count = updates * config.epochs * minibatches
        self._rng = np.random.default_rng((*training_stream(self._seed).entropy, steps_done))

    @property
    def _scale(self) -> float:
        """The factor of all rewards."""
        return VALUE_SCALE * (1.0 - self.config.discount)

    def _arrays(self) -> dict[str, np.ndarray]:
        """Return the arrays that a checkpoint keeps, by name."""
        found: dict[str, np.ndarray] = {}
        for net, adam in (("policy", self._policy_steps), ("value", self._value_steps)):
            kinds = {"weights": adam.arrays, "first": adam.first, "second": adam.second}
            for kind, arrays in kinds.items():
                found |= {f"{net}.{kind}.{k}": array for k, array in enumerate(arrays)}
        return found

    def _fly(self) -> float:
        """Fill the rollout; return the sum of all rewards."""
        lanes = self._lanes
        flown = self._rollout
        config = self.config
        obs = self._observed(lanes.obs)
        earned = 0.0
        for k in range(config.steps):
            noise = self._rng.standard_normal((config.environments, ACTIONS), np.float32)
            action = self._policy(obs) + np.exp(self._log_std) * noise
            flown.obs[k] = obs
            flown.actions[k] = action
            flown.log_chance[k] = -0.5 * np.sum(noise * noise, axis=1) - self._log_std.sum()
            flown.values[k] = self._value(obs)[:, 0]

            lanes.rows_to_lanes(action, self._actions)
            rewards = np.zeros(config.environments, np.float32)
            done = np.zeros(config.environments, bool)
            beyond = np.zeros(config.environments, np.float32)
            for _ in range(config.hold):
                lanes.step(self._actions)
                # what follows an end belongs to the next episode
                rewards += np.where(done, 0.0, self._used(lanes.reward))
                beyond += np.where(done, 0.0, self._value_beyond())
                done |= self._used(lanes.ended) | self._used(lanes.cut)
            earned += float(rewards.sum())
            flown.rewards[k] = rewards + config.discount * beyond
            flown.done[k] = done
            obs = self._observed(lanes.obs)
        flown.values[-1] = self._value(obs)[:, 0]
        return earned

    def _value_beyond(self) -> np.ndarray:
        """Return the value where an episode ends now that would go on but for its rules, else 0."""
        lanes = self._lanes
        finished = self._used(lanes.ended) & ~self._used(lanes.crashed) & self._loops
        goes_on = np.flatnonzero(self._used(lanes.cut) | finished)
        found = np.zeros(self.config.environments, np.float32)
        if len(goes_on):
            last = lanes.final[goes_on // LANES, :, goes_on % LANES]
            found[goes_on] = self._value(last)[:, 0]
        return found

    def _update(self) -> None:
        """Improve the policy and the value function by the rollout."""
        config = self.config
        batch = self._batch()
        rows = len(batch.returns)
        for _ in range(config.epochs):
            order = self._rng.permutation(rows)
            for begin in range(0, rows, config.minibatch):
                chosen = order[begin : begin + config.minibatch]
                for part in parts(chosen, AT_ONCE):
                    self._add_gradients(Batch._make(a[part] for a in batch), len(chosen))
                self._log_std_gradient -= np.float32(config.entropy)
                gradients = [*self._policy.gradients, self._log_std_gradient]
                self._policy_steps.step(gradients, self.rate)
                self._value_steps.step(self._value.gradients, self.rate)

    def _batch(self) -> Batch:
        """Return the rollout as rows, with generalised advantages (Schulman et al. 2016)."""
        config = self.config
        flown = self._rollout
        advantages = np.empty_like(flown.rewards)
        ahead = np.zeros(config.environments, np.float32)
        for k in reversed(range(config.steps)):
            lasts = 1.0 - flown.done[k]
            target = flown.rewards[k] + config.discount * lasts * flown.values[k + 1]
            ahead = target - flown.values[k] + config.discount * config.gae * lasts * ahead
            advantages[k] = ahead
        returns = advantages + flown.values[:-1]
        normal = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
        return Batch(
            obs=flown.obs.reshape(-1, SIZE),
            actions=flown.actions.reshape(-1, ACTIONS),
            log_chance=flown.log_chance.ravel(),
            advantages=normal.ravel(),
            returns=returns.ravel(),
        )

    def _add_gradients(self, part: Batch, rows: int) -> None:
        """Add the gradients of the losses of some rows.

        Args:
            part: the rows.
            rows: number of rows of the whole minibatch.
        """
        # log of the density: -z^2 / 2 - log std, without its constant
        off = part.actions - self._policy.forward(part.obs)
        by_mean = off * np.exp(-2.0 * self._log_std)
        log_chance = -0.5 * np.sum(off * by_mean, axis=1) - self._log_std.sum()
        ratio = np.exp(log_chance - part.log_chance)
        # an action that has become as likely or unlikely as it may does not count
        clip = self.config.clip
        gains = part.advantages > 0.0
        clipped = np.where(gains, ratio > 1.0 + clip, ratio < 1.0 - clip)
        slope = np.where(clipped, 0.0, -part.advantages * ratio)[:, None] / np.float32(rows)
        self._policy.backward(slope * by_mean)
        self._log_std_gradient += np.sum(slope * (off * by_mean - 1.0), axis=0)

        error = self._value.forward(part.obs)[:, 0] - part.returns
        self._value.backward(error[:, None] / np.float32(rows))

    def _observed(self, lanes: np.ndarray) -> np.ndarray:
        """Return observations by environment.  (environments, SIZE)"""
        rows = np.empty((self.config.environments, SIZE), np.float32)
        self._lanes.lanes_to_rows(lanes, rows)
        return rows

    def _used(self, lanes: np.ndarray) -> np.ndarray:
        """Return one number for each environment.  (blocks, LANES) -> (environments,)"""
        return lanes.ravel()[: self.config.environments]


def parts(rows: np.ndarray, size: int) -> Iterator[np.ndarray]:
    """Yield the rows in parts of a size, the last of which may be smaller."""
    for begin in range(0, len(rows), size):
        yield rows[begin : begin + size]


def scaled(weights: RewardWeights, scale: float) -> RewardWeights:
    """Return the weights times a scale."""
    terms = {name: scale * getattr(weights, name) for name in RewardParams._fields}
    return replace(weights, **terms)
