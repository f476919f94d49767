"""The hyperparameters of PPO."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PPOConfig:
    """The hyperparameters of PPO."""

    environments: int = 1024
    steps: int = 64  # actions of each environment between two updates
    hold: int = 2  # steps of the environment for which an action is held
    epochs: int = 3
    minibatch: int = 8192
    discount: float = 0.995
    gae: float = 0.98  # lambda of generalised advantage estimation
    clip: float = 0.2
    entropy: float = 0.001
    first_rate: float = 1e-3  # learning rate at the start
    last_rate: float = (
        5e-5  # learning rate at the end; it falls linearly with the share of the training
    )
    hidden: int = 64  # neurons of each of two hidden layers
    log_std: float = -1.0  # of actions in -1..1, at the start
