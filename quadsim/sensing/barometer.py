"""A barometer, which measures the height above the world's origin by the air pressure.

    height = p_z - wash a / g + sigma N(0, 1)

The wash of turning rotors changes the pressure at the sensor, so that it reads low in proportion to
the thrust a [m/s^2], by `wash` in hover. Teams of the AI Grand Prix have measured 1.6 to 3.9 m. The
estimator does not model this error.
"""

from __future__ import annotations

import numpy as np

from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.sensing.config import BarometerConfig
from quadsim.sensing.measurements import Height
from quadsim.sensing.timing import Ticks
from quadsim.vehicle import GRAVITY


class Barometer:
    """Samples the height of a flight."""

    def __init__(self, config: BarometerConfig, seeds: np.random.SeedSequence):
        """Draw the noise from the stream `seeds`."""
        self.latency = config.latency
        self._config = config
        self._ticks = Ticks(config.rate)
        self._rng = np.random.default_rng(seeds)

    def sample(self, state: PlantState[State]) -> Height | None:
        """Return the height if a sample is due, else None."""
        if not self._ticks.due(state.t):
            return None
        error = self._config.noise * self._rng.standard_normal()
        return Height(state.t, washed_height(state.x, self._config.wash) + error)


def washed_height(x: State, wash: float) -> float:
    """Return the height [m] that a barometer without noise measures under turning rotors.

    Args:
        x: state of the vehicle.
        wash: amount by which the barometer reads low in hover [m].
    """
    return x.pz - wash * x.thrust / GRAVITY
