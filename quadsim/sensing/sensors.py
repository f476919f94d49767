"""All sensors of one flight: they watch the plant, and hand over each measurement when it has arrived."""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import count
from typing import Any

import numpy as np

from quadsim.course import Gate
from quadsim.course.obstacles import Obstacle
from quadsim.physics.plant_state import PlantState
from quadsim.sensing.gate_camera import GateCamera
from quadsim.sensing.imu import Imu
from quadsim.sensing.measurements import Measurement
from quadsim.sensing.pose import PoseSensor
from quadsim.sensing.rotor_speeds import RotorSpeeds
from quadsim.sensing.sensing_file import Sensing
from quadsim.vehicle import Vehicle

WARM_UP = 0.5  # [s] for which the sensors run before the flight begins, the vehicle at rest


class Sensors:
    """Samples every physics step. Each sensor has a random stream of its own: none changes another's noise."""

    def __init__(
        self,
        sensing: Sensing,
        seeds: np.random.SeedSequence,
        vehicle: Vehicle,
        gates: Sequence[Gate],
        velocity_lag: float = 0.0,
        obstacles: Sequence[Obstacle] = (),
    ):
        """vehicle, gates: the true ones, as the plant has them; each gate once. velocity_lag: see Plant [s]."""
        streams = seeds.spawn(4)
        self._sensors: list[Any] = []
        if sensing.imu:
            self._sensors.append(Imu(sensing.imu, streams[0]))
        if sensing.rotors:
            self._sensors.append(RotorSpeeds(sensing.rotors, streams[1], vehicle))
        if sensing.pose:
            self._sensors.append(PoseSensor(sensing.pose, streams[2]))
        if sensing.camera:
            self._sensors.append(GateCamera(sensing.camera, streams[3], gates, obstacles))
        self._velocity_lag = velocity_lag
        self._before: PlantState | None = None
        self.truth: PlantState | None = None  # the last state that was sampled, position and velocity of one instant
        self._coming: list[tuple[float, int, Measurement]] = []  # a heap by the time of arrival
        self._number = count()

    def warm_up(self, state: PlantState, dt: float) -> None:
        """Sample the vehicle at rest at the flight's first state, for WARM_UP until just before it, every dt [s]."""
        for k in range(-round(WARM_UP / dt), 0):
            self.observe(PlantState(k * dt, state.x, ()))

    def observe(self, state: PlantState) -> None:
        """The state after a physics step."""
        self.truth = self._of_one_instant(state)
        for sensor in self._sensors:
            measurement = sensor.sample(self.truth)
            if measurement is not None:
                heappush(self._coming, (measurement.t + sensor.latency, next(self._number), measurement))

    def _of_one_instant(self, state: PlantState) -> PlantState:
        """The velocity extrapolated to the instant of the position, by the acceleration of the last step."""
        before, self._before = self._before, state
        if before is None or not self._velocity_lag:
            return state
        share = self._velocity_lag / (state.t - before.t)
        v = tuple(b + share * (b - a) for a, b in zip(before.x[3:6], state.x[3:6], strict=True))
        return PlantState(state.t, (*state.x[:3], *v, *state.x[6:]), state.contacts)

    def arrived(self, t: float) -> list[Measurement]:
        """What has arrived by t [s] since the last call, in the order of arrival."""
        found = []
        while self._coming and self._coming[0][0] <= t + 1e-9:
            found.append(heappop(self._coming)[2])
        return found
