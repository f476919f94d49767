"""The reward of a step: named terms with weights, and the plain function that the lanes inline.

    r = progress d + gate g - crash c - clearance m - body_rates |w|^2 - action_change |a - a_last|^2 - time

d is the way to the remaining gates that this step has shortened [m], measured as the racing cost measures it
(controllers.costs.race), so that what a flight collects is its whole way whatever path it takes; the terms are those of
Song et al. 2021, "Autonomous Drone Racing with Deep Reinforcement Learning", and Kaufmann et al. 2023.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass


@dataclass(frozen=True)
class RewardWeights:
    """Weights of the terms."""

    progress: float = 1.0  # per metre of the way to go that is flown
    gate: float = 0.0  # for each gate passed
    crash: float = 10.0  # for the end of an episode by a crash
    clearance: float = 2.5  # per metre by which the margin in a gate is not kept, per metre flown within it
    body_rates: float = 0.0005  # per squared body-rate command, each axis in units of its limit
    action_change: float = 0.002  # per squared change of the action, each in -1..1
    time: float = 0.0  # for each step
    margin: float = 0.2  # wanted between vehicle and frame within a gate [m]

    @property
    def params(self) -> tuple[float, ...]:
        """As `reward` takes them."""
        return astuple(self)[:-1]


def reward(progress, clearance, crashed, reached, action, last, p):
    """progress [m]; clearance: what is short of the margin, times the way in the gate [m^2]; crashed, reached: 0, 1."""
    a_0, a_1, a_2, a_3, a_4, a_5, a_6 = p
    wx, wy, wz, thrust = action
    dx, dy, dz, da = wx - last[0], wy - last[1], wz - last[2], thrust - last[3]
    rates = wx * wx + wy * wy + wz * wz
    change = dx * dx + dy * dy + dz * dz + da * da
    return a_0 * progress + a_1 * reached - a_2 * crashed - a_3 * clearance - a_4 * rates - a_5 * change - a_6
