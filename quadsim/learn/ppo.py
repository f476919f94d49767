"""PPO of stable-baselines3 (Schulman et al. 2017, Raffin et al. 2021) on the environments.

This module loads PyTorch, which takes seconds. Two things differ from the library's algorithm. An
action is held for several steps of the environment. A finish on a closed course counts as a
truncation and not as a termination: the policy does not observe the number of its lap, so the
return is bootstrapped with the value function.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import torch
from stable_baselines3 import PPO

from quadsim.controllers.lanes.layout import LANES
from quadsim.learn.ppo_config import PPOConfig
from quadsim.learn.reward import RewardParams, RewardWeights
from quadsim.learn.stable_baselines import RacingVecEnv
from quadsim.learn.starts import hover_action
from quadsim.learn.task import LearningTask
from quadsim.streams import training_stream

# Rewards are scaled so that a value is of the order of one: by this number, divided by the horizon
# of the discount in actions.
VALUE_SCALE = 10.0


class EndlessRaces(RacingVecEnv):
    """Environments that sum their rewards, and in which a finish is a truncation.

    Attributes:
        total: sum of all rewards since its last assignment.
    """

    def __init__(self, num_envs: int, task: LearningTask, hold: int, scale: float):
        """Make the environments.

        Args:
            num_envs: number of vehicles.
            task: courses, vehicle, starts and rewards.
            hold: steps of dt for which an action is held.
            scale: factor of the rewards.
        """
        super().__init__(num_envs, hold=hold, **_settings(task, scale))
        self.total = 0.0
        loops = np.array([course.loop for course in task.courses])
        # LANES environments in a row share a course
        self._on_loop = np.repeat(loops[self.envs.lanes.course], LANES)[:num_envs]

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict]]:
        """Simulate the steps of one action; see RacingVecEnv."""
        obs, reward, done, infos = super().step_wait()
        self.total += float(reward.sum())
        for i in np.flatnonzero(done & self._on_loop):
            if infos[i]["finished"]:
                infos[i]["TimeLimit.truncated"] = True
        return obs, reward, done, infos


class Learner:
    """A policy and its value function with the training environments.

    Args:
        task: courses, vehicle, starts and rewards.
        config: hyperparameters of the algorithm.
        seed: seed of the environments, the initial weights and the exploration.
    """

    def __init__(self, task: LearningTask, config: PPOConfig, seed: int):
        self.task = task
        self.config = config
        self.steps_done = 0  # of the environments
        self.rate = config.first_rate
        self._scale = VALUE_SCALE * (1.0 - config.discount)
        self._envs = EndlessRaces(config.environments, task, config.hold, self._scale)
        layers = [config.hidden, config.hidden]
        rollout = config.steps * config.environments
        self._model = PPO(
            "MlpPolicy",
            self._envs,
            learning_rate=lambda left: self.rate,
            n_steps=config.steps,
            batch_size=min(config.minibatch, rollout),
            n_epochs=config.epochs,
            gamma=config.discount,
            gae_lambda=config.gae,
            clip_range=config.clip,
            ent_coef=config.entropy,
            max_grad_norm=1.0,
            policy_kwargs={
                "net_arch": {"pi": layers, "vf": layers},
                "log_std_init": config.log_std,
                "activation_fn": torch.nn.ReLU,
            },
            seed=int(training_stream(seed).generate_state(1)[0]) % 2**31,
            device="cpu",
        )
        self._envs.seed(seed)
        # the untrained policy hovers
        hover = torch.as_tensor(hover_action(task.vehicle, task.dt))
        output = self._model.policy.action_net
        assert isinstance(output, torch.nn.Linear)
        with torch.no_grad():
            output.bias.copy_(hover)

    def learn(self) -> float:
        """Fly config.steps actions in every environment, then update the policy.

        Returns:
            The reward per second flown.
        """
        self._envs.total = 0.0
        actions = self.config.steps * self.config.environments
        self._model.learn(actions, reset_num_timesteps=False)
        steps = actions * self.config.hold
        self.steps_done += steps
        return self._envs.total / self._scale / (steps * self.task.dt)

    def pilot_weights(self) -> list[np.ndarray]:
        """Return matrix (inputs, outputs) and bias of each layer of the policy's mean network."""
        policy = self._model.policy
        hidden = policy.mlp_extractor.policy_net
        found: list[np.ndarray] = []
        for layer in (hidden[0], hidden[2], policy.action_net):
            assert isinstance(layer, torch.nn.Linear)
            found.append(layer.weight.detach().numpy().T.copy())
            found.append(layer.bias.detach().numpy().copy())
        return found

    def parameters(self) -> dict[str, np.ndarray]:
        """Return all parameters of policy and value function by name."""
        state = self._model.policy.state_dict()
        return {name: tensor.numpy().copy() for name, tensor in state.items()}

    def restore(self, parameters: Mapping[str, np.ndarray], steps_done: int) -> None:
        """Restore the parameters and the number of steps."""
        state = {name: torch.from_numpy(array) for name, array in parameters.items()}
        self._model.policy.load_state_dict(state)
        self.steps_done = steps_done


def scaled(weights: RewardWeights, scale: float) -> RewardWeights:
    """Return the weights times a scale."""
    terms = {name: scale * getattr(weights, name) for name in RewardParams._fields}
    return replace(weights, **terms)


def _settings(task: LearningTask, scale: float) -> dict[str, object]:
    """Return the keyword arguments of environments for this task."""
    return {
        "course": list(task.courses),
        "vehicle": task.vehicle,
        "laps": task.laps[0] if len(set(task.laps)) == 1 else None,
        "dt": task.dt,
        "start": task.start,
        "randomize": task.randomize,
        "time_limit": task.time_limit,
        "noise": task.noise,
        "reward": scaled(task.rewards, scale),
    }
