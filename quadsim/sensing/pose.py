"""A pose sensor: motion capture, or visual-inertial odometry (VIO), whose position drifts.

    position = p + drift + sigma_p N(0, 1),   drift' = walk N(0, 1)
    attitude = q exp(sigma_q N(0, 1)),        velocity = v + sigma_v N(0, 1)

A share of the samples are spikes: their position is wrong by a given distance in a random
direction. At each sample a dropout of a given duration begins with a given probability. Noise,
spikes and their sizes follow RotorPy 3.0.0's motion capture (spp/rotorpy, MIT); the drift as a
random walk is the usual model of odometry.
"""

from __future__ import annotations

from math import inf, radians

import numpy as np

from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import turned
from quadsim.sensing.config import PoseConfig
from quadsim.sensing.measurements import Pose
from quadsim.sensing.timing import Ticks


class PoseSensor:
    """Samples the true pose of a flight."""

    def __init__(self, config: PoseConfig, seeds: np.random.SeedSequence):
        """Start without drift and draw the noise from the stream `seeds`."""
        self.latency = config.latency
        self._config = config
        self._rng = np.random.default_rng(seeds)
        self._ticks = Ticks(config.rate)
        # [m]  (3,)
        self.drift = np.zeros(3)
        # time of the last sample [s]
        self._before = 0.0
        self._silent_until = -inf
        self._dies = inf if config.dies_at is None else config.dies_at

    def sample(self, state: PlantState[State]) -> Pose | None:
        """Return a sample if one is due and there is no dropout, else None."""
        t = state.t
        if not self._ticks.due(t):
            return None

        # Every sample takes the same number of draws, used or not.
        c = self._config
        drift, position, attitude, velocity, spike = self._rng.standard_normal((5, 3))
        begins, spikes = self._rng.random(2)

        # The drift begins with the flight, at t = 0.
        self.drift += c.drift * np.sqrt(max(t - self._before, 0.0)) * drift
        self._before = max(t, 0.0)
        if begins < c.dropouts and t > 0.0:
            self._silent_until = t + c.dropout
        if t < self._silent_until or t >= self._dies:
            return None

        p = np.array(state.x.position) + self.drift + c.position_noise * position
        if spikes < c.spikes:
            p += c.spike * spike / np.linalg.norm(spike)
        q = turned(state.x.attitude, radians(c.attitude_noise_deg) * attitude)
        v = None
        if c.velocity_noise is not None:
            v = tuple((np.array(state.x.velocity) + c.velocity_noise * velocity).tolist())
        return Pose(t, position=tuple(p.tolist()), attitude=q, velocity=v)
