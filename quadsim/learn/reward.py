"""The reward of a step: named terms with weights, and the plain function that the lanes inline.

    r = progress d + gate g - crash c - clearance m
        - body_rates |w|^2 - action_change |a - a_last|^2 - time

d is the way to the remaining gates that this step has shortened [m]. It is measured as the racing
cost measures it (controllers.costs.race), so that a flight collects its whole way whatever path it
takes. The terms are those of Song et al. 2021, "Autonomous Drone Racing with Deep Reinforcement
Learning", and Kaufmann et al. 2023.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class RewardParams(NamedTuple):
    """The weights of `reward`, named as in RewardWeights."""

    progress: float
    gate: float
    crash: float
    clearance: float
    body_rates: float
    action_change: float
    time: float


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the terms."""

    progress: float = 1.0  # per metre of the way to go that is flown
    gate: float = 0.0  # for each gate passed
    crash: float = 10.0  # for the end of an episode by a crash
    # per metre by which the margin in a gate is not kept, per metre flown within it
    clearance: float = 2.5
    body_rates: float = 0.0005  # per squared body-rate command, each axis in units of its limit
    action_change: float = 0.002  # per squared change of the action, each in -1..1
    time: float = 0.0  # for each step
    margin: float = 0.2  # wanted between vehicle and frame within a gate [m]

    @property
    def params(self) -> RewardParams:
        """The weights as `reward` takes them."""
        return RewardParams(
            progress=self.progress,
            gate=self.gate,
            crash=self.crash,
            clearance=self.clearance,
            body_rates=self.body_rates,
            action_change=self.action_change,
            time=self.time,
        )


def reward(progress, clearance, crashed, reached, action, last, p):
    """Return the reward of one step.

    Args:
        progress: decrease of the remaining way [m].
        clearance: what is short of the margin, times the way in the gate [m^2].
        crashed, reached: 0 or 1.
        action, last: this and the last action, Control in -1..1.
        p: RewardParams.
    """
    rates = action.wx * action.wx + action.wy * action.wy + action.wz * action.wz
    dx = action.wx - last.wx
    dy = action.wy - last.wy
    dz = action.wz - last.wz
    d_thrust = action.thrust - last.thrust
    change = dx * dx + dy * dy + dz * dz + d_thrust * d_thrust
    earned = p.progress * progress + p.gate * reached
    return (
        earned
        - p.crash * crashed
        - p.clearance * clearance
        - p.body_rates * rates
        - p.action_change * change
        - p.time
    )
