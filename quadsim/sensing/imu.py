"""The inertial measurement unit: gyroscope and accelerometer with white noise, walking biases and saturation.

    gyro = omega + b_g + sigma_g N(0, 1)                          b_g' = walk_g N(0, 1)
    specific force = R(q)^T (v' + g e_z) + b_a + sigma_a N(0, 1)   b_a' = walk_a N(0, 1)

The usual model of strapdown units (IEEE Std 952-1997, annex C; Woodman, "An introduction to inertial navigation",
Cambridge UCAM-CL-TR-696, 2007). omega and v' are means over the sample, as of units that integrate: the turn and the
change of velocity between two physics steps. So no plant has to be asked for its forces.
"""

from __future__ import annotations

import numpy as np

from quadsim.physics.plant_state import PlantState
from quadsim.sensing.attitude import between, rotate_back, turned
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
        self._last: PlantState | None = None

    def sample(self, state: PlantState) -> Inertial | None:
        """The unit's next sample, if the physics step that led to this state completes one."""
        last, self._last = self._last, self._last or state
        if last is None or not self._ticks.due(state.t):
            return None
        self._last, dt = state, state.t - last.t
        turn = between(last.x[6:10], state.x[6:10])
        middle = turned(last.x[6:10], tuple(0.5 * a for a in turn))
        ax, ay, az = ((b - a) / dt for a, b in zip(last.x[3:6], state.x[3:6], strict=True))
        true = np.array([*(a / dt for a in turn), *rotate_back(middle, (ax, ay, az + GRAVITY))])
        self.bias += self._walk * np.sqrt(dt) * self._rng.standard_normal(6)
        said = np.clip(true + self.bias + self._noise * self._rng.standard_normal(6), -self._most, self._most).tolist()
        return Inertial(state.t, dt, tuple(said[:3]), tuple(said[3:]))
