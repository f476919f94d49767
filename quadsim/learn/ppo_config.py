"""Numbers of the training's algorithm. Reading them needs no PyTorch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PPOConfig:
    """Numbers of the algorithm."""

    environments: int = 1024
    steps: int = 32  # actions of each environment between two updates
    hold: int = 2  # steps of the environment for which an action is held
    epochs: int = 3
    minibatch: int = 4096
    discount: float = 0.99
    gae: float = 0.95  # lambda of generalised advantage estimation
    clip: float = 0.2
    entropy: float = 0.001
    first_rate: float = 1e-3  # learning rate at the start
    last_rate: float = 5e-5  # and at the end; in between it falls in proportion to what is done
    hidden: int = 64  # neurons of each of two hidden layers
    log_std: float = -1.0  # of actions in -1..1, at the start
    # Share of a crash's weight at the start. A policy that fears crashes from the
    # start learns to hover.
    first_crash: float = 0.2
    # reward per second flown at which the share begins to grow, and at which it is 1
    crash_grows: tuple[float, float] = (4.0, 7.0)


def crash_share(reward: float, config: PPOConfig) -> float:
    """Return the share of a crash's weight for a policy that earns this reward [1/s]."""
    begins, ends = config.crash_grows
    grown = float(np.clip((reward - begins) / (ends - begins), 0.0, 1.0))
    return config.first_crash + (1.0 - config.first_crash) * grown
