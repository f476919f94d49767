"""The estimator: the vehicle's state at any later instant, from delayed measurements.

A measurement arrives after the instant at which it was taken, so the filter is kept at the instant
of the last measurement; from there the samples of the inertial measurement unit propagate the
nominal state to the present. A measurement that is older than the filter is applied at its own
time: the filter returns to its state before that time, applies the measurement, and repeats the
later ones.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, sqrt
from typing import NamedTuple, assert_never

import numpy as np

from quadsim.course import Gate, Start
from quadsim.rotation import Vec3, exp
from quadsim.sensing.estimation.motion import Motion
from quadsim.sensing.estimation.updates import CornerUpdate, HeightUpdate, Innovation, PoseUpdate
from quadsim.sensing.measurements import Aiding, Corners, Height, Inertial, Pose
from quadsim.sensing.nominal import Nominal
from quadsim.sensing.sensing_file import Sensing
from quadsim.sensing.state import MOVING, FilterState

# Initial standard deviations at the start pose: position [m], roll and pitch [deg], heading
# [deg], velocity [m/s].
SET_DOWN = 0.15
LEVEL = 0.5
HEADING = 6.0
AT_REST = 0.01
# [s] by which the filter may lag behind the longest latency of a measurement
BEHIND = 0.1
# [rad/s, m/s^2] standard deviation of biases whose given standard deviation is zero
LEAST_BIAS = 1e-4
# [m] initial standard deviation of the drift, and of the heights of gates
AS_MAPPED = 1e-3


@dataclass(frozen=True, slots=True)
class Applied:
    """A measurement that the filter has used, and the filter's state after it."""

    measurement: Aiding
    state: FilterState
    innovation: Innovation


class StateSeen(NamedTuple):
    """The filter's state at one instant, and how fast the vehicle turns."""

    state: FilterState
    # body rates [rad/s]
    rates: Vec3


class Estimator:
    """Estimates position, velocity, attitude, biases, drift and gate positions for one flight."""

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
            gates: gates of the map, each once.
            start: the known initial pose of the vehicle.
            t: time of that pose [s].
            displaced: largest displacement of each gate from the map, along x and y [m]; 0: the
                map is exact.
        """
        assert sensing.imu
        drift = sensing.pose.drift if sensing.pose else 0.0
        drifts = 3 if drift > 0.0 else 0
        unmapped = len(gates) if displaced > 0.0 else 0
        self._motion = Motion(sensing.imu, drift, MOVING + drifts + 3 * unmapped)
        self._pose = PoseUpdate(sensing.pose) if sensing.pose else None
        self._height = HeightUpdate(sensing.barometer) if sensing.barometer else None
        camera = sensing.corner_camera
        self._corners = CornerUpdate(camera, gates, unmapped > 0) if camera else None
        self._latest = sensing.latest
        self._samples: deque[Inertial] = deque()
        self.state = _set_down(sensing, start, t, drifts, unmapped, displaced)
        # recently applied measurements, and the state before all of them
        self._applied: deque[Applied] = deque()
        self._oldest = self.state
        # innovations of the measurements since the last `innovations.clear()`
        self.innovations: list[Innovation] = []

    def take(self, measurement: Inertial | Aiding) -> None:
        """Use a measurement that has just arrived."""
        if isinstance(measurement, Inertial):
            self._samples.append(measurement)
            return

        # Return to the state before its instant, then apply it and all later ones in order of time.
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
        """Return the nominal state at t [s], with the unit's last sample held constant."""
        self._catch_up(t)
        nominal = self.state.nominal
        for sample in self._samples:
            if sample.t > nominal.t:
                nominal = nominal.moved(sample, min(sample.t, t))
        if self._samples and t > nominal.t + 1e-9:
            nominal = nominal.moved(self._samples[-1], t)
        return nominal

    def seen_at(self, t: float) -> StateSeen:
        """Return the state of the filter and the body rates at t [s], the time of a picture."""
        earlier = [one.state for one in self._applied if one.measurement.t <= t]
        state = self._moved(t, earlier[-1] if earlier else self._oldest)
        sample = next((one for one in self._samples if one.t >= t), None)
        rates = state.nominal.rates(sample) if sample else (0.0, 0.0, 0.0)
        return StateSeen(state, rates)

    def covariance(self, t: float) -> np.ndarray:
        """Return the error covariance at t [s], propagated in one step.  (n, n)"""
        if not self._samples:
            return self.state.P
        return self._motion.moved(self.state, self._samples[-1], t)

    def _apply(self, measurement: Aiding) -> Innovation:
        """Move the filter to the instant of a measurement and correct it there."""
        before = self._moved(measurement.t, self.state)
        match measurement:
            case Pose():
                assert self._pose
                self.state, innovation = self._pose(before, measurement)
            case Height():
                assert self._height
                self.state, innovation = self._height(before, measurement)
            case Corners():
                assert self._corners
                self.state, innovation = self._corners(before, measurement)
            case _:
                assert_never(measurement)
        self._applied.append(Applied(measurement, self.state, innovation))
        return innovation

    def _moved(self, t: float, state: FilterState) -> FilterState:
        """Return a state of the filter propagated to t [s]; unchanged if t is not later."""
        for sample in self._samples:
            if sample.t > state.nominal.t and state.nominal.t < t:
                state = self._motion(state, sample, min(sample.t, t))
        return state

    def _catch_up(self, now: float) -> None:
        """Forget states that no delayed measurement can need, and samples before them."""
        oldest = now - self._latest - BEHIND
        while self._applied and self._applied[0].measurement.t < oldest:
            self._oldest = self._applied.popleft().state

        # If no measurement has arrived for a while, the filter is propagated without one.
        if self.state.nominal.t < oldest:
            self.state = self._moved(oldest, self.state)
            self._oldest = self.state
        while len(self._samples) > 1 and self._samples[0].t <= self._oldest.nominal.t:
            self._samples.popleft()


def _set_down(
    sensing: Sensing, start: Start, t: float, drifts: int, gates: int, displaced: float
) -> FilterState:
    """Return the filter's initial state, at rest in the start pose.

    Args:
        sensing: the vehicle's sensors.
        start: the known initial pose of the vehicle.
        t: time of that pose [s].
        drifts: number of states of an odometry's drift, 3 or 0.
        gates: number of gates whose positions are states.
        displaced: largest displacement of each gate from the map, along x and y [m].
    """
    imu = sensing.imu
    assert imu
    level = radians(LEVEL)
    heading = radians(HEADING)
    # standard deviation of a uniform distribution
    of_gates = displaced / sqrt(3)
    std = [SET_DOWN] * 3
    std += [AT_REST] * 3
    std += [level, level, heading]
    std += [max(imu.accelerometer_bias, LEAST_BIAS)] * 3
    std += [max(imu.gyro_bias, LEAST_BIAS)] * 3
    std += [AS_MAPPED] * drifts
    std += [of_gates, of_gates, AS_MAPPED] * gates
    rest = Nominal(t, start.position, (0.0, 0.0, 0.0), exp((0.0, 0.0, start.yaw)))
    return FilterState(rest, np.zeros(drifts), np.zeros((gates, 3)), np.diag(np.square(std)))
