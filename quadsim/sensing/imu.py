"""The inertial measurement unit: gyroscope and accelerometer with white noise, walking biases and
saturation.

    gyro = omega + b_g + sigma_g N(0, 1)                          b_g' = walk_g N(0, 1)
    specific force = R(q)^T (v' + g e_z) + b_a + sigma_a N(0, 1)   b_a' = walk_a N(0, 1)

The usual model of strapdown units (IEEE Std 952-1997, annex C; Woodman, "An introduction to
inertial navigation", Cambridge UCAM-CL-TR-696, 2007). omega and v' are means over the sample, as of
units that integrate: the turn and the change of velocity between two physics steps. So no plant has
to be asked for its forces.
"""

from __future__ import annotations

import numpy as np

from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import between, to_body, turned
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.measurements import Inertial
from quadsim.sensing.timing import Ticks
from quadsim.vehicle import GRAVITY


class Imu:
    """Samples a flight's truth."""

    def __init__(self, config: ImuConfig, seeds: np.random.SeedSequence):
        self.latency = config.latency
        self._config, self._rng = config, np.random.default_rng(seeds)
        c = config
        self._noise = np.repeat([c.gyro_noise, c.accelerometer_noise], 3)
        self._walk = np.repeat([c.gyro_walk, c.accelerometer_walk], 3)
        self._most = np.repeat([c.gyro_max, c.accelerometer_max], 3)
        self.bias = np.repeat([c.gyro_bias, c.accelerometer_bias], 3) * self._rng.standard_normal(6)
        self._ticks = Ticks(config.rate)
        self._last: PlantState[State] | None = None

    def sample(self, state: PlantState[State]) -> Inertial | None:
        """The unit's next sample, if the physics step that led to this state completes one."""
        last, self._last = self._last, self._last or state
        if last is None or not self._ticks.due(state.t):
            return None
        self._last = state
        dt = state.t - last.t
        # means over the sample: of the body rates by the turn, of the acceleration by the change of
        # velocity
        before, after = last.x, state.x
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
        self.bias += self._walk * np.sqrt(dt) * self._rng.standard_normal(6)
        noisy = true + self.bias + self._noise * self._rng.standard_normal(6)
        gx, gy, gz, fx, fy, fz = np.clip(noisy, -self._most, self._most).tolist()
        return Inertial(state.t, dt, gyro=(gx, gy, gz), specific_force=(fx, fy, fz))
