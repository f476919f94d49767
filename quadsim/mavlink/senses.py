"""Select the motion that is sent to the client: the true one, or the sensors' measurements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from quadsim.config.spec import Spec
from quadsim.dynamics.quadrotor import State
from quadsim.mavlink.telemetry import Motion
from quadsim.physics.plant import Plant
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import Vec3
from quadsim.sensing import Sensing
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.measurements import Height, Inertial, Pose
from quadsim.sensing.sensors import Sensors

# [Hz] of HIGHRES_IMU, without a set of sensors
IMU_RATE = 114.0


class Senses:
    """The motion that a client may know: the true one, or what sensors measure of it.

    Without a set of sensors the motion is the true one, and the inertial unit is exact. With one,
    the unit is the set's, and the motion is what its pose sensor has measured; with a set without
    a pose sensor there is no motion.

    Args:
        spec: specification of the flight.
        sensing: the set of sensors; None: the truth.
        plant: the plant of the flight, at rest.
    """

    def __init__(self, spec: Spec, sensing: Sensing | None, plant: Plant):
        self._is_exact = sensing is None
        if sensing is None:
            used = Sensing(name="exact", imu=ImuConfig(rate=IMU_RATE))
        else:
            # The client has pictures in place of the corners of gates.
            used = replace(sensing, camera=None, rotors=None)
        self._sensors = Sensors(
            used,
            spec.streams.sensors,
            spec.vehicle,
            gates=(),
            velocity_lag=getattr(plant, "velocity_lag", 0.0),
        )
        self._sensors.warm_up(plant.state, plant.dt)
        # Discards the samples from before the flight
        self._sensors.arrived(-plant.dt)
        self._samples: list[Inertial] = []
        self._measured: Motion | None = None
        self._last: Pose | None = None
        self._gyro: Vec3 = (0.0, 0.0, 0.0)
        # the last height of the barometer [m]; None: the sensors have none
        self.height: float | None = None

    def observe(self, state: PlantState[State]) -> None:
        """Note the state after a physics step."""
        self._sensors.observe(state)
        for measurement in self._sensors.arrived(state.t):
            if isinstance(measurement, Inertial):
                self._samples.append(measurement)
                self._gyro = measurement.gyro
            elif isinstance(measurement, Height):
                self.height = measurement.height
            elif isinstance(measurement, Pose):
                self._measured = self._motion_of(measurement)
                self._last = measurement

    def samples(self) -> list[Inertial]:
        """Return the samples of the inertial unit that have come since the last call."""
        found = self._samples
        self._samples = []
        return found

    @property
    def motion(self) -> Motion | None:
        """The motion that the client may know; None: it is unknown."""
        if not self._is_exact:
            return self._measured
        truth = self._sensors.truth
        if truth is None:
            return None
        x = truth.x
        return Motion(x.position, x.velocity, x.attitude, x.body_rates)

    def _motion_of(self, pose: Pose) -> Motion:
        """Return the motion of a measured pose; without a measured velocity, that of two poses."""
        velocity = pose.velocity
        if velocity is None:
            velocity = (0.0, 0.0, 0.0)
            if self._last is not None:
                way = np.array(pose.position) - np.array(self._last.position)
                vx, vy, vz = (way / (pose.t - self._last.t)).tolist()
                velocity = (vx, vy, vz)
        return Motion(pose.position, velocity, pose.attitude, self._gyro)
