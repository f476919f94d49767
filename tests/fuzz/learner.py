"""`race train` without PyTorch: a learner that takes no time, with all that is written and read."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from types import ModuleType

import numpy as np

from quadsim.cli import train as command
from quadsim.cli.cli import race
from quadsim.controllers.learned.observation import SIZE
from quadsim.learn.ppo_config import PPOConfig
from quadsim.learn.starts import hover_action
from quadsim.learn.task import LearningTask

HIDDEN = 8
SHAPES = ((SIZE, HIDDEN), (HIDDEN,), (HIDDEN, HIDDEN), (HIDDEN,), (HIDDEN, 4), (4,))


class FakeLearner:
    """A learner with the functions of quadsim.learn.ppo.Learner, whose policy hovers."""

    def __init__(self, task: LearningTask, config: PPOConfig, seed: int):
        self.config = config
        self.task = task
        self.steps_done = 0
        self.rate = config.first_rate
        rng = np.random.default_rng(seed)
        self._weights = [0.01 * rng.normal(size=shape).astype(np.float32) for shape in SHAPES]
        self._weights[-1][:] = hover_action(task.vehicle, task.dt)

    def learn(self) -> float:
        """Change the policy a little; return a reward that grows with the steps."""
        self.steps_done += 32 * self.config.environments * self.config.hold
        for array in self._weights[:-1]:
            array *= np.float32(0.99)
        return self.steps_done / 1e5

    def pilot_weights(self) -> list[np.ndarray]:
        """Return matrix and bias of each layer."""
        return [array.copy() for array in self._weights]

    def parameters(self) -> dict[str, np.ndarray]:
        """Return all numbers by name."""
        return {f"layer.{k}": array.copy() for k, array in enumerate(self._weights)}

    def restore(self, parameters: Mapping[str, np.ndarray], steps_done: int) -> None:
        """Go on from these parameters."""
        self._weights = [parameters[f"layer.{k}"].copy() for k in range(len(SHAPES))]
        self.steps_done = steps_done


def module() -> ModuleType:
    """Return a module in the place of quadsim.learn.ppo, which needs PyTorch."""
    made = ModuleType("quadsim.learn.ppo")
    made.__dict__["Learner"] = FakeLearner
    return made


def train() -> int:
    """Run `race train` with the arguments of the process, and return the exit code."""
    sys.modules["quadsim.learn.ppo"] = module()
    # it asks whether PyTorch's own learner is installed
    command.__dict__["find_spec"] = is_installed
    return race(sys.argv[1:])


def is_installed(name: str) -> bool:
    """Say that a package is installed."""
    return bool(name)
