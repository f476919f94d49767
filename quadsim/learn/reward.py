"""The reward of a step: named terms with weights, and a plain function for the compiled lanes.

    r = progress d + gate g - crash c - clearance m
        - body_rates |w|^2 - action_change |a - a_last|^2 - time

d is the progress: the decrease of the remaining way through the gates [m], measured as in the
racing cost (quadsim.controllers.costs.race), so that the sum over a flight does not depend on its
path. The terms follow Song et al. 2021, "Autonomous Drone Racing with Deep Reinforcement Learning",
and Kaufmann et al. 2023.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from quadsim.files.strict_yaml import setting
from quadsim.files.values import check_fields

MOST = 1e6  # largest weight


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
    """Weights of the reward's terms.

    Raises:
        SettingError: a weight is not a number, or out of range (a ValueError).

    Examples:
        >>> from quadsim.learn.reward import RewardWeights
        >>> from quadsim.learn.vector_env import RacingVectorEnv
        >>> envs = RacingVectorEnv(64, course="figure8", reward=RewardWeights(crash=5.0))
    """

    progress: Annotated[
        float, setting("per metre of progress along the remaining way", ge=-MOST, le=MOST)
    ] = 1.0
    gate: Annotated[float, setting("for each gate passed", ge=-MOST, le=MOST)] = 0.0
    crash: Annotated[float, setting("for the end of an episode by a crash", ge=-MOST, le=MOST)] = (
        10.0
    )
    clearance: Annotated[
        float,
        setting(
            "per metre short of the margin in a gate, per metre flown within the gate",
            ge=-MOST,
            le=MOST,
        ),
    ] = 2.5
    body_rates: Annotated[
        float,
        setting(
            "per squared body-rate command, each axis in units of its limit", ge=-MOST, le=MOST
        ),
    ] = 0.0005
    action_change: Annotated[
        float,
        setting("per squared change of the action, each in -1..1", ge=-MOST, le=MOST),
    ] = 0.002
    time: Annotated[float, setting("for each step", ge=-MOST, le=MOST)] = 0.0
    margin: Annotated[
        float, setting("clearance between vehicle and frame within a gate", unit="m", ge=0, le=10)
    ] = 0.2

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def params(self) -> RewardParams:
        """The weights as a tuple for `reward`."""
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
        progress: decrease of the remaining way through the gates [m].
        clearance: shortfall of the margin times the distance flown in the gate [m^2].
        crashed, reached: 1 if the vehicle has crashed or has passed a gate, else 0.
        action, last: this and the previous action, Control in -1..1.
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
