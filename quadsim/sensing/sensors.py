"""All sensors of one flight: they watch the plant, and hand over each measurement when it has
arrived."""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heappop, heappush
from itertools import count
from typing import Any

import numpy as np

from quadsim.course import Gate
from quadsim.course.obstacles import Obstacle
from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.sensing.gate_camera import GateCamera
from quadsim.sensing.imu import Imu
from quadsim.sensing.measurements import Measurement
from quadsim.sensing.pose import PoseSensor
from quadsim.sensing.rotor_speeds import RotorSpeeds
from quadsim.sensing.sensing_file import Sensing
from quadsim.streams import sensor_streams
from quadsim.vehicle import Vehicle

WARM_UP = 0.5  # [s] for which the sensors run before the flight begins, the vehicle at rest


class Sensors:
    """Samples every physics step. Each sensor has a random stream of its own: none changes
    another's noise."""

    def __init__(
        self,
        sensing: Sensing,
        seeds: np.random.SeedSequence,
        vehicle: Vehicle,
        gates: Sequence[Gate],
        velocity_lag: float = 0.0,
        obstacles: Sequence[Obstacle] = (),
    ):
        """vehicle, gates: the true ones, as the plant has them; each gate once. velocity_lag: see
        Plant [s]."""
        streams = sensor_streams(seeds)
        self._sensors: list[Any] = []
        if sensing.imu:
            self._sensors.append(Imu(sensing.imu, streams.imu))
        if sensing.rotors:
            self._sensors.append(RotorSpeeds(sensing.rotors, streams.rotors, vehicle))
        if sensing.pose:
            self._sensors.append(PoseSensor(sensing.pose, streams.pose))
        if sensing.camera:
            self._sensors.append(GateCamera(sensing.camera, streams.camera, gates, obstacles))
        self._velocity_lag = velocity_lag
        self._before: PlantState[State] | None = None
        self.truth: PlantState[State] | None = (
            None  # the last state that was sampled, position and velocity of one instant
        )
        self._coming: list[tuple[float, int, Measurement]] = []  # a heap by the time of arrival
        self._number = count()

    def warm_up(self, state: PlantState[State], dt: float) -> None:
        """Sample the vehicle at rest at the flight's first state, for WARM_UP until just before it,
        every dt [s]."""
        for k in range(-round(WARM_UP / dt), 0):
            self.observe(PlantState(k * dt, state.x, ()))

    def observe(self, state: PlantState[State]) -> None:
        """The state after a physics step."""
        self.truth = self._of_one_instant(state)
        for sensor in self._sensors:
            measurement = sensor.sample(self.truth)
            if measurement is not None:
                heappush(
                    self._coming, (measurement.t + sensor.latency, next(self._number), measurement)
                )

    def _of_one_instant(self, state: PlantState[State]) -> PlantState[State]:
        """Return the state with its velocity extrapolated to the instant of the position, by the
        acceleration of the last step."""
        before, self._before = self._before, state
        if before is None or not self._velocity_lag:
            return state
        share = self._velocity_lag / (state.t - before.t)
        last, x = before.x, state.x
        velocity = (
            x.vx + share * (x.vx - last.vx),
            x.vy + share * (x.vy - last.vy),
            x.vz + share * (x.vz - last.vz),
        )
        moved = State.of(
            x.position, velocity, x.attitude, x.body_rates, x.thrust, x.angular_acceleration
        )
        return PlantState(state.t, moved, state.contacts)

    def arrived(self, t: float) -> list[Measurement]:
        """What has arrived by t [s] since the last call, in the order of arrival."""
        found = []
        while self._coming and self._coming[0][0] <= t + 1e-9:
            found.append(heappop(self._coming)[2])
        return found
