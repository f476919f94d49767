"""The inertial measurement unit: a gyroscope and an accelerometer.

Both have white noise, random-walk biases, scale factors, misaligned axes, and limits:

    gyro = M_g omega + b_g + sigma_g N(0, 1)                          b_g' = walk_g N(0, 1)
    specific force = M_a R(q)^T (v' + g e_z) + b_a + sigma_a N(0, 1)   b_a' = walk_a N(0, 1)
    M = I + diag(scale N(0, 1)) + misalignment N(0, 1) off the diagonal, constant in a flight

This is the usual model of strapdown units (IEEE Std 952-1997, annex C; Woodman, "An introduction to
inertial navigation", Cambridge UCAM-CL-TR-696, 2007). omega and v' are means over the sample, as
an integrating unit measures them: the rotation and the change of velocity between two physics
steps. The sensor therefore needs no forces from the plant.

A vibration of the rotors, A sin(2 pi f t) with a different phase on each axis of the specific
force, is not averaged, but sampled at the end of the interval. It is aliased if the unit is read at
a low rate without a filter: at 32 Hz, a vibration of 130 Hz appears as one of 2 Hz.
"""

from __future__ import annotations

import numpy as np

from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import between, to_body, turned
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.measurements import Inertial
from quadsim.sensing.timing import Ticks
from quadsim.streams import alignment_stream
from quadsim.vehicle import GRAVITY

# Phases of the vibration on the three axes [rad]
PHASES = 2.0 * np.pi / 3.0 * np.arange(3)


class Imu:
    """Samples the true motion of a flight."""

    def __init__(self, config: ImuConfig, seeds: np.random.SeedSequence):
        """Draw the initial biases from the stream `seeds`."""
        self.latency = config.latency
        self._rng = np.random.default_rng(seeds)
        # Numbers of the gyroscope's three axes, then of the accelerometer's three
        self._noise = np.repeat([config.gyro_noise, config.accelerometer_noise], 3)
        self._walk = np.repeat([config.gyro_walk, config.accelerometer_walk], 3)
        self._limits = np.repeat([config.gyro_max, config.accelerometer_max], 3)
        bias_std = np.repeat([config.gyro_bias, config.accelerometer_bias], 3)
        # [rad/s, m/s^2]  (6,)
        self.bias = bias_std * self._rng.standard_normal(6)
        self._mixing = drawn_mixing(config, seeds)
        self._vibration = config.vibration
        self._turns = 2.0 * np.pi * config.vibration_hz
        self._ticks = Ticks(config.rate)
        # state at the end of the last sample
        self._last: PlantState[State] | None = None

    def sample(self, state: PlantState[State]) -> Inertial | None:
        """Return a sample if the physics step that led to this state completes one, else None."""
        last = self._last
        if last is None:
            self._last = state
            return None
        if not self._ticks.due(state.t):
            return None
        self._last = state

        # Means over the sample: body rates from the rotation, acceleration from the change of
        # velocity, in the attitude at mid-sample.
        dt = state.t - last.t
        before = last.x
        after = state.x
        turn = between(before.attitude, after.attitude)
        body_rates = [angle / dt for angle in turn]
        acceleration = (
            (after.vx - before.vx) / dt,
            (after.vy - before.vy) / dt,
            (after.vz - before.vz) / dt + GRAVITY,
        )
        middle = turned(before.attitude, [0.5 * angle for angle in turn])
        specific_force = to_body(middle, acceleration)
        true = np.array([*body_rates, *specific_force])
        if self._vibration:
            true[3:] += self._vibration * np.sin(self._turns * state.t + PHASES)
        if self._mixing is not None:
            true = self._mixing @ true

        # The unit's errors.
        self.bias += self._walk * np.sqrt(dt) * self._rng.standard_normal(6)
        noisy = true + self.bias + self._noise * self._rng.standard_normal(6)
        gx, gy, gz, fx, fy, fz = np.clip(noisy, -self._limits, self._limits).tolist()
        return Inertial(state.t, dt, gyro=(gx, gy, gz), specific_force=(fx, fy, fz))


def drawn_mixing(config: ImuConfig, seeds: np.random.SeedSequence) -> np.ndarray | None:
    """Return the random matrix from true to measured rates and forces, by scale and axes.

    Each axis has its own scale factor. It also measures a share of the two other axes, equal to the
    angle [rad] by which it is tilted towards them.

    Args:
        config: parameters of the unit.
        seeds: the stream of the unit.

    Returns:
        The matrix  (6, 6), None if scales and axes are exact.
    """
    scales = (config.gyro_scale, config.accelerometer_scale)
    angles = (config.gyro_misalignment_deg, config.accelerometer_misalignment_deg)
    if not any(scales) and not any(angles):
        return None
    rng = np.random.default_rng(alignment_stream(seeds))
    mixing = np.eye(6)
    for part, scale, angle in zip((slice(0, 3), slice(3, 6)), scales, angles, strict=True):
        drawn = rng.standard_normal((3, 3))
        size = np.where(np.eye(3, dtype=bool), scale, np.radians(angle))
        mixing[part, part] += size * drawn
    return mixing
