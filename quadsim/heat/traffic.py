"""The traffic of a race: the perceived states and announced plans of its vehicles.

A vehicle perceives the states of the others with noise and delay. It may also announce its plan.
Times count from the first start of the race.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.random import SeedSequence

from quadsim.dynamics.expected_path import ExpectedPath
from quadsim.dynamics.quadrotor import State
from quadsim.rotation import Quaternion, Vec3

ROUNDING = 1e-9  # [s]


class Sight(NamedTuple):
    """The noise and the delay with which a vehicle perceives the others."""

    # standard deviations of the noise, per axis [m], [m/s]
    position_noise: float = 0.0
    velocity_noise: float = 0.0
    # age of the perceived states [s]
    delay: float = 0.0


class Sighting(NamedTuple):
    """The state of a vehicle as another vehicle perceives it."""

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


class Noted(NamedTuple):
    """The state of a vehicle after a physics step."""

    t: float
    x: State
    passed: int


class Traffic:
    """The states of all vehicles, and the plans that they have announced."""

    def __init__(self, vehicles: int, sight: Sight, streams: list[SeedSequence]):
        """Begin before the start.

        Args:
            vehicles: number of vehicles.
            sight: noise and delay with which vehicles perceive each other.
            streams: random stream of the noise of each vehicle's perception.
        """
        self._sight = sight
        self._noted: list[deque[Noted]] = [deque() for _ in range(vehicles)]
        self._left = [False] * vehicles
        self._rngs = [np.random.default_rng(stream) for stream in streams]
        self._announced: list[ExpectedPath | None] = [None] * vehicles
        # plans that are not yet known to the others
        self._pending: dict[int, ExpectedPath] = {}

    def note(self, k: int, t: float, x: State, passed: int) -> None:
        """Record the state of vehicle k at t [s], and the number of gates that it has passed."""
        noted = self._noted[k]
        noted.append(Noted(t, x, passed))
        # Keep the newest state that can be seen, and all later states.
        seen_until = t - self._sight.delay + ROUNDING
        while len(noted) > 1 and noted[1].t <= seen_until:
            noted.popleft()

    def leave(self, k: int) -> None:
        """Remove vehicle k from the traffic, because its flight has ended."""
        self._left[k] = True

    def sightings(self, k: int, t: float) -> dict[int, Sighting]:
        """Return the sightings of other vehicles by vehicle k at t [s], by number.

        A vehicle that has not started, or has left, is not among them.
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
        """Return the state of a vehicle as vehicle k perceives it."""
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

    def announce(self, k: int, path: ExpectedPath) -> None:
        """Announce the plan of vehicle k, which the others know from the next planning on."""
        self._pending[k] = path

    def publish(self) -> None:
        """Make the plans announced so far known to all vehicles.

        It is called after all vehicles that plan at an instant have planned, so that the knowledge
        of a vehicle does not depend on the order in which plans are computed.
        """
        for k, path in self._pending.items():
            self._announced[k] = path
        self._pending.clear()

    def announced(self, m: int) -> ExpectedPath | None:
        """Return the last known plan of vehicle m, None if it has announced no plan."""
        return self._announced[m]
