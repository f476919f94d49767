"""The estimator: measurements in the order in which they arrive -> the vehicle's state at any
instant after them.

A measurement is of an instant before it arrives, so the filter is kept at the instant of the last
one; from there the nominal state is moved to the present by the samples of the inertial measurement
unit. A measurement that is older than the filter is applied at its own time: the filter goes back
to its state before it and applies what came later again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, sqrt

import numpy as np

from quadsim.course import Gate, Start
from quadsim.rotation import exp
from quadsim.sensing.estimation.error_state import MOVING, FilterState, Motion
from quadsim.sensing.estimation.nominal import Nominal
from quadsim.sensing.estimation.updates import CornerUpdate, Innovation, PoseUpdate
from quadsim.sensing.measurements import Corners, Inertial, Pose
from quadsim.sensing.sensing_file import Sensing

# Standard deviations of what is known where the vehicle is set down: position [m], level and
# heading [deg].
SET_DOWN, LEVEL, HEADING = 0.15, 0.5, 6.0
AT_REST = 0.01  # [m/s]
BEHIND = 0.1  # [s] by which the filter may stay behind the latest that a measurement can come
LEAST_BIAS = 1e-4  # [rad/s, m/s^2] standard deviation of biases that are given as zero
# [m] standard deviation of a drift that has not begun, and of the heights of gates
AS_MAPPED = 1e-3


@dataclass(frozen=True, slots=True)
class Applied:
    """A measurement that the filter has used, and its state after that."""

    measurement: Pose | Corners
    state: FilterState
    innovation: Innovation


class Estimator:
    """Estimates position, velocity, attitude, biases, drift and where gates stand, for one
    flight."""

    def __init__(
        self,
        sensing: Sensing,
        gates: Sequence[Gate],
        start: Start,
        t: float,
        displaced: float = 0.0,
    ):
        """Start at rest.

        Args:
            sensing: the vehicle's sensors.
            gates: of the map, each once.
            start: where the vehicle is set down, as it is known.
            t: when that is [s].
            displaced: how far each gate may stand off the map, along x and y [m]; 0: the map is
                taken as true.
        """
        assert sensing.imu
        drift = sensing.pose.drift if sensing.pose else 0.0
        drifts = 3 if drift > 0.0 else 0
        unmapped = len(gates) if displaced > 0.0 else 0
        self._motion = Motion(sensing.imu, drift, MOVING + drifts + 3 * unmapped)
        self._pose = PoseUpdate(sensing.pose) if sensing.pose else None
        self._corners = (
            CornerUpdate(sensing.camera, gates, unmapped > 0) if sensing.camera else None
        )
        self._latest = sensing.latest
        self._samples: deque[Inertial] = deque()
        self.state = _set_down(sensing, start, t, drifts, unmapped, displaced)
        self._oldest = self.state  # before every measurement of `_applied`
        self._applied: deque[Applied] = deque()
        # of the measurements taken since the last `innovations.clear()`
        self.innovations: list[Innovation] = []

    def take(self, measurement: Inertial | Pose | Corners) -> None:
        """Use a measurement that has just arrived."""
        if isinstance(measurement, Inertial):
            self._samples.append(measurement)
            return

        # Go back to before it, then apply it and all that is later in the order of their instants.
        pending = [measurement]
        while self._applied and self._applied[-1].measurement.t > measurement.t:
            pending.append(self._applied.pop().measurement)
        if len(pending) > 1:
            self.state = self._applied[-1].state if self._applied else self._oldest
        for one in sorted(pending, key=lambda m: m.t):
            innovation = self._apply(one)
            if one is measurement:
                self.innovations.append(innovation)

    def at(self, t: float) -> Nominal:
        """Return the vehicle at t [s], the last sample of the unit held to there."""
        self._catch_up(t)
        nominal = self.state.nominal
        for sample in self._samples:
            if sample.t > nominal.t:
                nominal = nominal.moved(sample, min(sample.t, t))
        if self._samples and t > nominal.t + 1e-9:
            nominal = nominal.moved(self._samples[-1], t)
        return nominal

    def covariance(self, t: float) -> np.ndarray:
        """Return that of the error at t [s], by one step from the filter's instant.  (states,
        states)"""
        return (
            self._motion.moved(self.state, self._samples[-1], t) if self._samples else self.state.P
        )

    def _apply(self, measurement: Pose | Corners) -> Innovation:
        """Move the filter to the instant of a measurement and correct it there."""
        before = self._moved(measurement.t)
        match measurement:
            case Pose():
                assert self._pose
                self.state, innovation = self._pose(before, measurement)
            case Corners():
                assert self._corners
                self.state, innovation = self._corners(before, measurement)
        self._applied.append(Applied(measurement, self.state, innovation))
        return innovation

    def _moved(self, t: float) -> FilterState:
        """The filter's state at t [s], if that is later than it."""
        state = self.state
        for sample in self._samples:
            if sample.t > state.nominal.t and state.nominal.t < t:
                state = self._motion(state, sample, min(sample.t, t))
        return state

    def _catch_up(self, now: float) -> None:
        """Forget what no measurement can be older than; move on where none has come for a while."""
        oldest = now - self._latest - BEHIND
        while self._applied and self._applied[0].measurement.t < oldest:
            self._oldest = self._applied.popleft().state
        if self.state.nominal.t < oldest:
            self.state = self._oldest = self._moved(oldest)
        while (
            self._samples
            and self._samples[0].t <= self._oldest.nominal.t
            and len(self._samples) > 1
        ):
            self._samples.popleft()


def _set_down(
    sensing: Sensing, start: Start, t: float, drifts: int, gates: int, displaced: float
) -> FilterState:
    """At rest at the start, as well as it is known there."""
    imu = sensing.imu
    assert imu
    level, heading = radians(LEVEL), radians(HEADING)
    of_gates = displaced / sqrt(3)  # of a uniform distribution
    std = [SET_DOWN] * 3
    std += [AT_REST] * 3
    std += [level, level, heading]
    std += [max(imu.accelerometer_bias, LEAST_BIAS)] * 3
    std += [max(imu.gyro_bias, LEAST_BIAS)] * 3
    std += [AS_MAPPED] * drifts
    std += [of_gates, of_gates, AS_MAPPED] * gates
    rest = Nominal(t, start.position, (0.0, 0.0, 0.0), exp((0.0, 0.0, start.yaw)))
    return FilterState(rest, np.zeros(drifts), np.zeros((gates, 3)), np.diag(np.square(std)))
