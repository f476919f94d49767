"""Samples that pass a vehicle ahead on its left or on its right.

To each of these samples the same pulse of roll rate is added, beside its own perturbation:

    p(t) = p_0 cos(2 pi t / tau),   d = a p_0 tau^3 / (4 pi^2)

Within tau the roll angle and the sideways velocity come back to what they were, and the vehicle is
displaced by d. The thrust a is that of the plan. The angle is taken to be small, and the lag of the
body rates is left out.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from controllers.lanes.layout import LANES, block

if TYPE_CHECKING:
    from controllers.mppi import MPPI

PULSE = 0.8  # tau [s]
# The controls by their order in quadsim.dynamics.quadrotor.Control
ROLL_RATE = 0
THRUST = 3


class Sides:
    """Lets a share of a planner's samples pass on both sides."""

    def __init__(self, share: float, aside: float):
        """Begin with nobody to pass.

        Args:
            share: share of the samples, half of which pass on either side.
            aside: how far aside they are displaced [m].
        """
        # In each block the lanes behind the first one, whose sample 0 is the plan itself
        count = round(share * LANES / 2)
        self._left = slice(1, 1 + count)
        self._right = slice(1 + count, min(1 + 2 * count, LANES))
        self._aside = aside
        self._planner: MPPI | None = None  # whose samples are displaced
        # pulse to the left in even and in odd blocks [rad/s]  (2, T); None: nobody is to be passed
        self._pulse: np.ndarray | None = None

    def offer(self, planner: MPPI, wanted: bool) -> None:
        """Let the samples of the next plan pass on both sides, or not.

        Args:
            planner: the planner.
            wanted: whether there is a vehicle to pass.
        """
        if planner is not self._planner:
            self._displace_samples_of(planner)
        self._pulse = None
        if wanted:
            # Perturbations are multiplied by the ramp.
            self._pulse = pulse_to_left(planner, self._aside) / planner.ramp

    def _displace_samples_of(self, planner: MPPI) -> None:
        """Add the pulses to what the planner's sampler draws from now on."""
        drawn = planner.sampler.sample
        horizon = planner.config.horizon

        def sample(*args: int) -> np.ndarray:
            z = drawn(*args)  # (series, n_u, halves * T, LANES)
            if self._pulse is not None:
                series, _, steps, _ = z.shape
                for b in range(series * steps // horizon):
                    roll = block(z, b, horizon)[ROLL_RATE]  # (T, LANES)
                    pulse = self._pulse[b % 2][:, None]
                    roll[:, self._left] += pulse
                    roll[:, self._right] -= pulse
            return z

        planner.sampler = replace(planner.sampler, sample=sample)
        self._planner = planner


def pulse_to_left(planner: MPPI, aside: float) -> np.ndarray:
    """Return the roll rates that displace the flight of a plan to the left [rad/s].  (T,)

    Args:
        planner: the planner.
        aside: by how far [m].
    """
    config = planner.config
    t = config.dt * np.arange(config.horizon)
    during = t < PULSE
    thrust = planner.clipped(planner.plan)[during, THRUST].mean()
    # To the left, against the sense of a positive roll
    p0 = -aside * 4.0 * np.pi**2 / (max(thrust, 1.0) * PULSE**3)
    return np.where(during, p0 * np.cos(2.0 * np.pi * t / PULSE), 0.0)
