"""Rotor speeds, as electronic speed controllers report them, and the thrust that they stand for.

    T_i = thrust map of rotor i (W_i + sigma N(0, 1)),   thrust = sum T_i / m

The plant's flight controller knows its own thrust map, by which it allocates, so that the thrust is
read off the same map. The mass is the nominal one.
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

    latency = 0.0

    def __init__(self, config: RotorConfig, seeds: np.random.SeedSequence, vehicle: Vehicle):
        self._rng, self._ticks = np.random.default_rng(seeds), Ticks(config.rate)
        self._rotors, self._mass, self._noise = vehicle.rotors, vehicle.mass, config.noise

    def sample(self, state: PlantState[State]) -> RotorThrust | None:
        """The thrust by the speeds, if a sample is due. A vehicle without rotors is taken at its
        word."""
        if not self._ticks.due(state.t):
            return None
        errors = self._rng.standard_normal(4)
        thrust = state.x.thrust
        if self._rotors:  # the noise of four speeds about their mean
            rotors = self._rotors
            speed = rotors.speed(max(0.25 * self._mass * thrust, rotors.thrust_map[2]))
            thrust = (
                sum(rotors.thrust(speed + self._noise * e) for e in errors.tolist()) / self._mass
            )
        return RotorThrust(state.t, thrust)
