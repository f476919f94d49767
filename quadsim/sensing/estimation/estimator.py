"""The estimator: measurements in the order in which they arrive -> the vehicle's state at any instant after them.

A measurement is of an instant before it arrives, so the filter is kept at the instant of the last one; from there the
nominal state is moved to the present by the samples of the inertial measurement unit. One that is older than the
filter is applied at its own time: the filter goes back to the belief before it and takes what came later again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, sqrt

import numpy as np

from quadsim.course import Gate, Start
from quadsim.sensing.attitude import exp
from quadsim.sensing.estimation.error_state import MOVING, Belief, Motion
from quadsim.sensing.estimation.nominal import Nominal
from quadsim.sensing.estimation.updates import CornerUpdate, Innovation, PoseUpdate
from quadsim.sensing.measurements import Corners, Inertial, Pose
from quadsim.sensing.sensing_file import Sensing

# Standard deviations of what is known where the vehicle is set down: position [m], level and heading [deg].
SET_DOWN, LEVEL, HEADING = 0.15, 0.5, 6.0
AT_REST = 0.01  # [m/s]
BEHIND = 0.1  # [s] by which the filter may stay behind the latest that a measurement can come
LEAST_BIAS = 1e-4  # [rad/s, m/s^2] standard deviation of biases that are said to be zero


@dataclass(frozen=True, slots=True)
class Taken:
    """A measurement and the belief after it."""

    said: Pose | Corners
    belief: Belief
    innovation: Innovation


class Estimator:
    """Estimates position, velocity, attitude, biases, drift and where gates stand, for one flight."""

    def __init__(self, sensing: Sensing, gates: Sequence[Gate], start: Start, t: float, displaced: float = 0.0):
        """gates: of the map, each once. start: where the vehicle is said to stand, at rest, at t [s].
        displaced: how far each gate may stand off the map, along x and y [m]; 0: the map is taken as true."""
        assert sensing.imu
        drift = sensing.pose.drift if sensing.pose else 0.0
        free = displaced > 0.0
        self._motion = Motion(sensing.imu, drift, MOVING + 3 * (drift > 0.0) + 3 * len(gates) * free)
        self._pose = PoseUpdate(sensing.pose) if sensing.pose else None
        self._corners = CornerUpdate(sensing.camera, gates, free) if sensing.camera else None
        self._latest = sensing.latest
        self._samples: deque[Inertial] = deque()
        self.belief = _set_down(sensing, start, t, 3 if drift > 0.0 else 0, len(gates) if free else 0, displaced)
        self._before = self.belief  # all that is taken again starts here
        self._taken: deque[Taken] = deque()
        self.innovations: list[Innovation] = []  # of the measurements taken since the last `innovations.clear()`

    def take(self, said: Inertial | Pose | Corners) -> None:
        """A measurement that has just arrived."""
        if isinstance(said, Inertial):
            self._samples.append(said)
            return
        again = [said]
        while self._taken and self._taken[-1].said.t > said.t:
            again.append(self._taken.pop().said)
        if len(again) > 1:
            self.belief = self._taken[-1].belief if self._taken else self._before
        for one in sorted(again, key=lambda m: m.t):
            self._apply(one, fresh=one is said)

    def at(self, t: float) -> Nominal:
        """The vehicle at t [s], the last sample of the unit held to there."""
        self._catch_up(t)
        nominal = self.belief.nominal
        for sample in self._samples:
            if sample.t > nominal.t:
                nominal = nominal.moved(sample, min(sample.t, t))
        return nominal.moved(self._samples[-1], t) if self._samples and t > nominal.t + 1e-9 else nominal

    def covariance(self, t: float) -> np.ndarray:
        """Of the error at t [s], by one step from the filter's instant.  (states, states)"""
        return self._motion.moved(self.belief, self._samples[-1], t) if self._samples else self.belief.P

    def _apply(self, said: Pose | Corners, fresh: bool) -> None:
        update = self._pose if isinstance(said, Pose) else self._corners
        assert update
        self.belief, innovation = update(self._moved(said.t), said)  # pyright: ignore
        self._taken.append(Taken(said, self.belief, innovation))
        if fresh:
            self.innovations.append(innovation)

    def _moved(self, t: float) -> Belief:
        """The belief at t [s], if that is later than it."""
        belief = self.belief
        for sample in self._samples:
            if sample.t > belief.nominal.t and belief.nominal.t < t:
                belief = self._motion(belief, sample, min(sample.t, t))
        return belief

    def _catch_up(self, now: float) -> None:
        """Forget what no measurement can be older than; move on where none has come for a while."""
        oldest = now - self._latest - BEHIND
        while self._taken and self._taken[0].said.t < oldest:
            self._before = self._taken.popleft().belief
        if self.belief.nominal.t < oldest:
            self.belief = self._before = self._moved(oldest)
        while self._samples and self._samples[0].t <= self._before.nominal.t and len(self._samples) > 1:
            self._samples.popleft()


def _set_down(sensing: Sensing, start: Start, t: float, drifts: int, gates: int, displaced: float) -> Belief:
    """At rest at the start, as well as it is known there."""
    imu = sensing.imu
    assert imu
    level, heading = radians(LEVEL), radians(HEADING)
    biases = max(imu.accelerometer_bias, LEAST_BIAS), max(imu.gyro_bias, LEAST_BIAS)
    std = [SET_DOWN] * 3 + [AT_REST] * 3 + [level, level, heading] + [biases[0]] * 3 + [biases[1]] * 3
    std += [1e-3] * drifts + [displaced / sqrt(3), displaced / sqrt(3), 1e-3] * gates  # of a uniform distribution
    rest = Nominal(t, tuple(start.position), (0.0, 0.0, 0.0), exp((0.0, 0.0, start.yaw)))
    return Belief(rest, np.zeros(drifts), np.zeros((gates, 3)), np.diag(np.square(std)))
