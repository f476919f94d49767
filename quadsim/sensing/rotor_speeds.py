"""A sensor of the thrust, from rotor speeds that electronic speed controllers report.

    T_i = thrust map of rotor i (W_i + sigma N(0, 1)),   thrust = sum T_i / m

The thrust map is the same as in the flight controller's allocation. The mass is nominal.
"""

from __future__ import annotations

import numpy as np

from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.sensing.config import RotorConfig
from quadsim.sensing.measurements import RotorThrust
from quadsim.sensing.timing import Ticks
from quadsim.vehicle import Vehicle


class RotorSpeeds:
    """Samples the thrust that a flight's rotors deliver."""

    def __init__(self, config: RotorConfig, seeds: np.random.SeedSequence, vehicle: Vehicle):
        """Measure the thrust of a vehicle, with noise from the stream `seeds`."""
        self.latency = config.latency
        self._rng = np.random.default_rng(seeds)
        self._ticks = Ticks(config.rate)
        self._rotors = vehicle.rotors
        self._mass = vehicle.mass
        self._noise = config.noise

    def sample(self, state: PlantState[State]) -> RotorThrust | None:
        """Return the thrust from the rotors' speeds if a sample is due, else None.

        For a vehicle without rotors, the thrust is exact.
        """
        if not self._ticks.due(state.t):
            return None
        errors = self._rng.standard_normal(4).tolist()
        thrust = state.x.thrust
        rotors = self._rotors
        if rotors:
            # Each rotor is at the common speed of this thrust, plus its own noise.
            speed = rotors.speed(max(0.25 * self._mass * thrust, rotors.thrust_map[2]))
            thrusts = [rotors.thrust(speed + self._noise * error) for error in errors]
            thrust = sum(thrusts) / self._mass
        return RotorThrust(state.t, thrust)
