"""Proximal Policy Optimization (PPO, Schulman et al. 2017) in numpy on the compiled environments.

Two perceptrons: the mean of a Gaussian over actions, its standard deviations free numbers beside
it, and the value of a state. Advantages by generalised advantage estimation (GAE, Schulman et al.
2016). The learning rate follows the Kullback-Leibler divergence between the policies before and
after a minibatch's step, as in Rudin et al. 2022. At these sizes numpy's matrix products are most
of the work, so that no other library is needed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from controllers.lanes.environment import SAME_STEP
from controllers.learned import network
from controllers.learned.network import Adam
from controllers.learned.observation import SIZE
from quadsim.learn.lanes import LaneEnvironments
from quadsim.learn.starts import hover_action
from quadsim.learn.task import LearningTask
from quadsim.streams import training_stream

ACTIONS = 4
REWARD_SCALE = 0.1  # so that values are of the order of one


@dataclass(frozen=True)
class PPOConfig:
    """Numbers of the algorithm."""

    environments: int = 1024
    steps: int = 32  # actions of each environment between two updates
    hold: int = 2  # steps of the environment for which an action is held
    epochs: int = 4
    minibatch: int = 4096
    discount: float = 0.99
    gae: float = 0.95  # lambda of the advantage estimation
    clip: float = 0.2
    entropy: float = 0.001
    target_kl: float = 0.012
    rate: float = 3e-4  # learning rate at the start
    rates: tuple[float, float] = (2e-5, 2e-3)  # between which it is adapted
    hidden: int = 64
    log_std: float = -1.0  # of actions in -1..1, at the start
    # share of a crash's weight at the start: who fears crashes from the start learns to hover
    first_crash: float = 0.2
    # reward per second flown at which it begins to grow, and is whole
    crash_grows: tuple[float, float] = (4.0, 7.0)


@dataclass
class Batch:
    """What was collected; rows are (steps * environments)."""

    obs: np.ndarray
    actions: np.ndarray
    log_p: np.ndarray
    advantage: np.ndarray
    target: np.ndarray  # of the value
    mean: np.ndarray  # of the policy that collected


class PPO:
    """A policy, its value function and their optimisers, with the environments they learn in."""

    def __init__(self, task: LearningTask, config: PPOConfig, seed: int = 0):
        self.task, self.config, self.seed = task, config, seed
        self.rng = np.random.default_rng(training_stream(seed))
        sizes = (SIZE, config.hidden, config.hidden)
        self.policy = network.new((*sizes, ACTIONS), self.rng)
        self.policy[-1][:] = hover_action(task.vehicle, task.dt)
        # last: logarithms of standard deviations
        self.policy.append(np.full(ACTIONS, config.log_std, np.float32))
        self.value = network.new((*sizes, 1), self.rng, last=1.0)
        self.adam, self.value_adam = Adam(self.policy), Adam(self.value)
        self.rate, self.updates = config.rate, 0
        self.reward = 0.0  # per second flown, in what was collected last
        self.envs = LaneEnvironments(task, config.environments, seed, SAME_STEP)
        self.envs.begin(seed)
        self._actions = np.zeros_like(self.envs.last)
        self._obs = self._rows(self.envs.obs)

    @property
    def steps_done(self) -> int:
        """Steps of the environments."""
        return self.updates * self.config.environments * self.config.steps * self.config.hold

    def learn(self) -> dict[str, float]:
        """Collect once, update once; what happened."""
        (begins, ends), first = self.config.crash_grows, self.config.first_crash
        share = first + (1 - first) * float(np.clip((self.reward - begins) / (ends - begins), 0, 1))
        self.envs.reward_by(replace(self.task.rewards, crash=share * self.task.rewards.crash))
        batch, seen = self.collect()
        self.reward = seen["reward"]
        seen |= self.update(batch)
        self.updates += 1
        return seen | {
            "steps": self.steps_done,
            "rate": self.rate,
            "std": float(np.exp(self.policy[-1]).mean()),
        }

    def collect(self) -> tuple[Batch, dict[str, float]]:
        """Fly config.steps steps in every environment."""
        c, e, n, f = self.config, self.envs, self.config.environments, np.float32
        obs, act, mean = (np.empty((c.steps, n, k), f) for k in (SIZE, ACTIONS, ACTIONS))
        log_p, reward, value, ahead = (np.empty((c.steps, n), f) for _ in range(4))
        ended, cut = np.empty((c.steps, n), bool), np.empty((c.steps, n), bool)
        std = np.exp(self.policy[-1])
        passes = crashes = finishes = 0
        for t in range(c.steps):
            obs[t] = self._obs
            mean[t] = network.forward(self.policy[:-1], self._obs)
            act[t] = mean[t] + std * self.rng.standard_normal((n, ACTIONS), dtype=f)
            log_p[t] = log_density(act[t], mean[t], self.policy[-1])
            value[t] = network.forward(self.value, self._obs)[:, 0]
            e.rows_to_lanes(act[t], self._actions)
            reward[t], ended[t], cut[t] = 0.0, False, False
            for _ in range(c.hold):
                e.step(self._actions)
                reward[t] += e.reward.ravel()[:n]
                ended[t] |= e.ended.ravel()[:n]
                cut[t] |= e.cut.ravel()[:n]
                passes, crashes = (
                    passes + e.hit.ravel()[:n].sum(),
                    crashes + e.crashed.ravel()[:n].sum(),
                )
                finishes += (e.ended & ~e.crashed).ravel()[:n].sum()
            self._obs = self._rows(e.obs)
            ahead[t] = network.forward(self.value, self._obs)[:, 0] if t == c.steps - 1 else 0
            if cut[t].any():
                ahead[t, cut[t]] = network.forward(self.value, self._rows(e.final)[cut[t]])[:, 0]
        ahead[:-1] = np.where(cut[:-1], ahead[:-1], value[1:])
        advantage = gae(REWARD_SCALE * reward, value, ahead, ended, cut, c.discount, c.gae)
        flat = [
            a.reshape(c.steps * n, -1)
            for a in (obs, act, log_p, advantage, advantage + value, mean)
        ]
        batch = Batch(flat[0], flat[1], flat[2][:, 0], flat[3][:, 0], flat[4][:, 0], flat[5])
        flown = c.steps * n * c.hold * self.task.dt
        seen = {
            "reward": reward.sum() / flown,
            "passes": passes / flown,
            "crashes": crashes / flown,
        }
        return batch, {k: float(v) for k, v in (seen | {"finishes": finishes / flown}).items()}

    def update(self, batch: Batch) -> dict[str, float]:
        """Epochs of minibatches in random order."""
        c, rows = self.config, len(batch.obs)
        a = batch.advantage
        a = (a - a.mean()) / (a.std() + np.float32(1e-8))
        kls, losses = [], []
        for _ in range(c.epochs):
            order = self.rng.permutation(rows)
            for first in range(0, rows, c.minibatch):
                pick = order[first : first + c.minibatch]
                x = batch.obs[pick]
                kls.append(
                    self._policy_step(
                        x, batch.actions[pick], batch.log_p[pick], a[pick], batch.mean[pick]
                    )
                )
                losses.append(self._value_step(x, batch.target[pick]))
        np.clip(self.policy[-1], -3.0, 0.0, out=self.policy[-1])
        return {"kl": float(np.mean(kls)), "value_loss": float(np.mean(losses))}

    def _policy_step(
        self, x: np.ndarray, act: np.ndarray, old: np.ndarray, a: np.ndarray, mean: np.ndarray
    ) -> float:
        c, log_std = self.config, self.policy[-1]
        layers = network.activations(self.policy[:-1], x)
        off, variance = act - layers[-1], np.exp(2 * log_std)
        change = log_density(act, layers[-1], log_std) - old
        ratio = np.exp(np.minimum(change, 10))
        free = np.where(a > 0, ratio < 1 + c.clip, ratio > 1 - c.clip)
        d_log_p = (-a * ratio * free / len(x)).astype(np.float32)[:, None]
        g = network.gradient(self.policy[:-1], layers, d_log_p * off / variance)
        g.append((d_log_p * (off * off / variance - 1)).sum(0) - np.float32(c.entropy))
        # of the means: the widths move slowly
        kl = float(((layers[-1] - mean) ** 2 / variance).sum(1).mean() / 2)
        if kl > 2 * c.target_kl:
            self.rate = max(self.rate / 1.5, c.rates[0])
        elif kl < c.target_kl / 2:
            self.rate = min(self.rate * 1.1, c.rates[1])
        self.adam.step(self.policy, g, self.rate)
        return kl

    def _value_step(self, x: np.ndarray, target: np.ndarray) -> float:
        layers = network.activations(self.value, x)
        off = layers[-1][:, 0] - target
        g = network.gradient(self.value, layers, (off / len(x)).astype(np.float32)[:, None])
        self.value_adam.step(self.value, g, min(self.rate, 1e-3))
        return float((off * off).mean())

    def _rows(self, lanes: np.ndarray) -> np.ndarray:
        rows = np.empty((self.config.environments, lanes.shape[1]), np.float32)
        self.envs.lanes_to_rows(lanes, rows)
        return rows


def log_density(act: np.ndarray, mean: np.ndarray, log_std: np.ndarray) -> np.ndarray:
    """Of independent Gaussians, up to a constant.  (rows, n), (rows, n), (n,) -> (rows,)"""
    z = (act - mean) * np.exp(-log_std)
    return -(z * z).sum(1) / 2 - log_std.sum()


def gae(
    reward: np.ndarray,
    value: np.ndarray,
    ahead: np.ndarray,
    ended: np.ndarray,
    cut: np.ndarray,
    gamma: float,
    lam: float,
) -> np.ndarray:
    """A_t = delta_t + gamma lam A_{t+1}, delta_t = r_t + gamma V(s_{t+1}) - V(s_t); nothing follows
    an end.  (T, n)

    ahead: V(s_{t+1}), also where an episode was cut there.
    """
    found, later = np.empty_like(reward), np.zeros_like(reward[0])
    delta = reward + gamma * ahead * ~ended - value
    for t in range(len(reward) - 1, -1, -1):
        later = delta[t] + gamma * lam * later * ~(ended[t] | cut[t])
        found[t] = later
    return found
