"""The gate camera: corners of gates' openings in each picture, with noise and false matches.

A corner can be found if it is in front of the camera, in the picture, in range and not nearer than
`blind_within`, and if no other frame and no obstacle blocks its line of sight. It is found with a
Gaussian error of `noise` pixels; a share of the corners is missed, independently or in bursts, a
share is found at a random place in the picture, and a share is matched to a different corner.
Bursts follow Gilbert's model, as in quadsim.physics.link, with one channel for each corner and one
step for each picture. Swift (Kaufmann et al., Nature 2023) and Foehn et al. ("AlphaPilot:
Autonomous drone racing", Autonomous Robots 46, 2022) use corners, found by a network, as landmarks.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np

from quadsim.course import Gate
from quadsim.course.obstacles import Obstacle
from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import matrix
from quadsim.sensing.config import GateCameraConfig
from quadsim.sensing.dropouts import Dropouts
from quadsim.sensing.measurements import Corners
from quadsim.sensing.timing import Ticks
from quadsim.sensing.visibility import hidden
from quadsim.streams import miss_stream


class GateCamera:
    """Takes pictures of a flight's true gates."""

    def __init__(
        self,
        config: GateCameraConfig,
        seeds: np.random.SeedSequence,
        gates: Sequence[Gate],
        obstacles: Sequence[Obstacle] = (),
    ):
        """Make a camera that sees gates and obstacles.

        Args:
            config: the camera.
            seeds: random stream of the noise and the false matches.
            gates: the distinct gates, in the order of their indices.
            obstacles: obstacles, which may hide corners.
        """
        self.latency = config.latency
        self._config = config
        self._rng = np.random.default_rng(seeds)
        self._dropouts = Dropouts(config.dropouts, config.dropout, seeds)
        # Another one, and whether each corner is missed in a burst now  (corners,)
        self._bursts = np.random.default_rng(miss_stream(seeds))
        self._missed: np.ndarray | None = None
        self._ticks = Ticks(config.rate)
        self._gates = tuple(gates)
        self._obstacles = tuple(obstacles)
        self._corners = np.array([gate.corners() for gate in gates])  # (gates, 4, 3)
        self._dies = inf if config.dies_at is None else config.dies_at

    def sample(self, state: PlantState[State]) -> Corners | None:
        """Return the corners found in a picture if one is taken at this step, else None."""
        if not self._ticks.due(state.t) or state.t >= self._dies:
            return None

        # Corners in front of the camera, in the picture and in range.
        position = np.array(state.x.position)
        points = self._corners.reshape(-1, 3) - position
        pixels, seen = self._config.in_view(points @ matrix(state.x.attitude))
        apart = (points**2).sum(axis=1)
        seen &= apart <= self._config.range**2
        if self._config.blind_within:
            seen &= apart >= self._config.blind_within**2

        # Keep the corners with a free line of sight.
        for k in np.flatnonzero(seen.reshape(-1, 4).any(axis=1)).tolist():
            others = self._gates[:k] + self._gates[k + 1 :]
            seen[4 * k : 4 * k + 4] &= ~hidden(self._corners[k], position, others, self._obstacles)
        found = self._found(state.t, pixels, np.flatnonzero(seen))
        return None if self._dropouts.lost(state.t) else found

    def _missed_in_bursts(self, n: int) -> np.ndarray:
        """Return which of n corners are missed in this picture.  (n,) bool"""
        share = self._config.misses
        length = self._config.miss_burst or 1.0
        draws = self._bursts.random(n)
        if self._missed is None:
            self._missed = draws < share
        else:
            begins = share / (length * (1.0 - share))
            self._missed = np.where(self._missed, draws >= 1.0 / length, draws < begins)
        return self._missed

    def _found(self, t: float, pixels: np.ndarray, view: np.ndarray) -> Corners:
        """Return the found corners among the corners in view.

        Args:
            t: time of the exposure [s].
            pixels: pixels of all corners of the course  (n, 2).
            view: indices of the corners in view.
        """
        # Every picture takes the same number of draws.
        n = len(pixels)
        noise = self._rng.standard_normal((n, 2))
        miss, out, swap = self._rng.random((n, 3)).T
        anywhere = self._rng.random((n, 2))
        other = self._rng.integers(0, n, n)

        # Some corners are missed, the rest is found with noise.
        c = self._config
        missed = miss < c.misses if c.miss_burst is None else self._missed_in_bursts(n)
        found = view[~missed[view]]
        at = pixels[found] + c.noise * noise[found]

        # Some are found anywhere in the picture, some are matched to a different corner.
        outlier = out[found] < c.outliers
        at[outlier] = anywhere[found][outlier] * (c.width, c.height)
        taken_for = np.where(swap[found] < c.swaps, other[found], found)
        return Corners(t, gates=taken_for // 4, corners=taken_for % 4, pixels=at, in_view=len(view))
