"""Traffic: what each vehicle of a race knows of the others.

Everybody sees where the others are, with noise and late. A vehicle may also tell the others its
plan. Times are those of the race, which count from the first start.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.random import SeedSequence

from quadsim.dynamics.quadrotor import State
from quadsim.rotation import Quaternion, Vec3

ROUNDING = 1e-9  # [s]


class Sight(NamedTuple):
    """How well a vehicle sees the others."""

    # standard deviations of the noise, per axis [m], [m/s]
    position_noise: float = 0.0
    velocity_noise: float = 0.0
    # how old what it sees is [s]
    delay: float = 0.0


class Sighting(NamedTuple):
    """A vehicle as another one sees it."""

    # when it was there [s]
    t: float
    # [m]
    position: Vec3
    # [m/s]
    velocity: Vec3
    # wxyz
    attitude: Quaternion
    # gates passed by then
    passed: int


class ExpectedPath(NamedTuple):
    """A path that a vehicle is expected to fly."""

    # time of the first position [s]
    t0: float
    # time from one position to the next [s]
    dt: float
    # [m]  (n, 3), at least two
    positions: np.ndarray

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the positions at some times [m]  (len(times), 3).

        Between positions it is a straight line, and beyond them the line goes on.

        Args:
            times: [s].
        """
        k = (times - self.t0) / self.dt
        # Conversion to int rounds down, as none of these is negative.
        first = np.minimum(np.maximum(k, 0.0), len(self.positions) - 2).astype(int)
        start = self.positions[first]
        share = (k - first)[:, None]
        return start + share * (self.positions[first + 1] - start)


class Noted(NamedTuple):
    """The state of a vehicle after a physics step."""

    t: float
    x: State
    passed: int


class Traffic:
    """Keeps where all vehicles are, and what they have told the others."""

    def __init__(self, vehicles: int, sight: Sight, streams: list[SeedSequence]):
        """Begin before the start.

        Args:
            vehicles: their number.
            sight: how well they see each other.
            streams: the stream of the noise of each vehicle's sightings.
        """
        self._sight = sight
        self._noted: list[deque[Noted]] = [deque() for _ in range(vehicles)]
        self._left = [False] * vehicles
        self._rngs = [np.random.default_rng(stream) for stream in streams]
        self._told: list[ExpectedPath | None] = [None] * vehicles
        self._to_tell: dict[int, ExpectedPath] = {}

    def note(self, k: int, t: float, x: State, passed: int) -> None:
        """Note the state of vehicle k at t [s], and the gates that it has passed."""
        noted = self._noted[k]
        noted.append(Noted(t, x, passed))
        # The newest that has been seen, and those after it, are kept.
        seen_until = t - self._sight.delay + ROUNDING
        while len(noted) > 1 and noted[1].t <= seen_until:
            noted.popleft()

    def leave(self, k: int) -> None:
        """Take vehicle k out of the traffic, as it is out or has finished."""
        self._left[k] = True

    def sightings(self, k: int, t: float) -> dict[int, Sighting]:
        """Return what vehicle k sees of the others at t [s]: number -> Sighting.

        A vehicle that has not started, or has left, is not there.
        """
        seen = {}
        for m, noted in enumerate(self._noted):
            if m == k or self._left[m] or not noted:
                continue
            latest = noted[0]
            for one in noted:
                if one.t > t - self._sight.delay + ROUNDING:
                    break
                latest = one
            seen[m] = self._with_noise(k, latest)
        return seen

    def _with_noise(self, k: int, noted: Noted) -> Sighting:
        """Return the state of a vehicle as vehicle k sees it."""
        x = noted.x
        position: Vec3 = x.position
        velocity: Vec3 = x.velocity
        sight = self._sight
        if sight.position_noise or sight.velocity_noise:
            drawn = self._rngs[k].standard_normal(6)
            a, b, c = (np.array(position) + sight.position_noise * drawn[:3]).tolist()
            position = (a, b, c)
            a, b, c = (np.array(velocity) + sight.velocity_noise * drawn[3:]).tolist()
            velocity = (a, b, c)
        return Sighting(noted.t, position, velocity, x.attitude, noted.passed)

    def tell(self, k: int, path: ExpectedPath) -> None:
        """Let vehicle k tell its plan, which the others know from the next instant on."""
        self._to_tell[k] = path

    def pass_on(self) -> None:
        """Let everybody know the plans told so far.

        It is called when all have planned that plan at an instant, so that none of them knows more
        than the others because of the order in which they are computed.
        """
        for k, path in self._to_tell.items():
            self._told[k] = path
        self._to_tell.clear()

    def told(self, m: int) -> ExpectedPath | None:
        """Return the last plan that vehicle m has told; None where it has told none."""
        return self._told[m]
