"""The gate camera: which corners of gates' openings stand in each picture, found with noise, misses
and mistakes.

A corner is found if it is in front of the camera, in the picture and in range, with no other frame
and no obstacle before it. It is found `noise` pixels off, Gaussian; a share is missed, a share is
found anywhere, a share is taken for another corner. Corners found by a network and used as
landmarks are the way of Swift (Kaufmann et al., Nature 2023) and of Foehn et al., "AlphaPilot:
Autonomous drone racing", Autonomous Robots 46, 2022.
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
from quadsim.sensing.camera_model import GateCameraConfig
from quadsim.sensing.measurements import Corners
from quadsim.sensing.timing import Ticks
from quadsim.sensing.visibility import hidden


class GateCamera:
    """Looks at a flight's true gates."""

    def __init__(
        self,
        config: GateCameraConfig,
        seeds: np.random.SeedSequence,
        gates: Sequence[Gate],
        obstacles: Sequence[Obstacle] = (),
    ):
        """gates: each once, in the order of their indices."""
        self.latency = config.latency
        self._config, self._rng = config, np.random.default_rng(seeds)
        self._ticks = Ticks(config.rate)
        self._gates, self._obstacles = tuple(gates), tuple(obstacles)
        self._corners = np.array([gate.corners() for gate in gates])  # (gates, 4, 3)
        self._dies = inf if config.dies_at is None else config.dies_at

    def sample(self, state: PlantState[State]) -> Corners | None:
        """What is found in the picture, if one is taken at this step."""
        if not self._ticks.due(state.t) or state.t >= self._dies:
            return None
        p, c = np.array(state.x.position), self._config
        points = self._corners.reshape(-1, 3) - p
        pixels, seen = c.seen(points @ matrix(state.x.attitude))
        seen &= (points**2).sum(axis=1) <= c.range**2
        for k in np.flatnonzero(seen.reshape(-1, 4).any(axis=1)).tolist():
            others = self._gates[:k] + self._gates[k + 1 :]
            seen[4 * k : 4 * k + 4] &= ~hidden(self._corners[k], p, others, self._obstacles)
        return self._found(state.t, pixels, np.flatnonzero(seen))

    def _found(self, t: float, pixels: np.ndarray, view: np.ndarray) -> Corners:
        """Noise, misses, outliers and false associations; a fixed number of draws a picture."""
        c, rng, n = self._config, self._rng, len(pixels)
        noise, luck, anywhere = rng.standard_normal((n, 2)), rng.random((n, 3)), rng.random((n, 2))
        other = rng.integers(0, n, n)
        found = view[luck[view, 0] >= c.misses]
        at = pixels[found] + c.noise * noise[found]
        outlier = luck[found, 1] < c.outliers
        at[outlier] = anywhere[found][outlier] * (c.width, c.height)
        called = np.where(luck[found, 2] < c.swaps, other[found], found)
        return Corners(t, called // 4, called % 4, at, len(view))
