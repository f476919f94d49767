"""All sensors of a flight, which sample the plant and deliver measurements after a latency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple, Protocol

import numpy as np

from quadsim.course import Gate
from quadsim.course.obstacles import Obstacle
from quadsim.dynamics.quadrotor import State
from quadsim.physics.faults import BiasJump, FaultOfSensor, SensorFault, sensor_key
from quadsim.physics.plant_state import PlantState
from quadsim.sensing.barometer import Barometer
from quadsim.sensing.gate_camera import GateCamera
from quadsim.sensing.imu import Imu
from quadsim.sensing.measurements import Inertial, Measurement
from quadsim.sensing.pixel_camera import Eye, PixelCamera
from quadsim.sensing.pose import PoseSensor
from quadsim.sensing.rotor_speeds import RotorSpeeds
from quadsim.sensing.sensing_file import Sensing
from quadsim.streams import sensor_streams
from quadsim.vehicle import Vehicle

# [s] duration for which the sensors run before the flight, with the vehicle at rest
WARM_UP = 0.5
# rows of the bias of an inertial unit, by part
BIAS_OF = {"gyro": slice(0, 3), "accelerometer": slice(3, 6)}


class Sensor(Protocol):
    """A sensor that samples at its own instants."""

    # latency from the instant of a measurement to its arrival [s]
    latency: float

    def sample(self, state: PlantState[State]) -> Measurement | None:
        """Return a measurement if one is due in this true state, else None."""
        ...


class BiasedImu:
    """An inertial measurement unit with a bias that jumps while a fault lasts."""

    def __init__(self, imu: Imu | BiasedImu, fault: BiasJump):
        """Add a fault to an inertial unit.

        Args:
            imu: the inertial measurement unit.
            fault: the bias, its direction and its time.
        """
        self.latency = imu.latency
        self.bias = imu.bias
        self._imu = imu
        self._window = fault.window
        self._jump = np.zeros(6)
        self._jump[BIAS_OF[fault.sensor]] = fault.jump
        self._has_jumped = False

    def sample(self, state: PlantState[State]) -> Inertial | None:
        """Return the unit's sample with the bias added."""
        active = self._window.active(state.t)
        if active and not self._has_jumped:
            self.bias += self._jump
        if self._has_jumped and not active:
            self.bias -= self._jump
        self._has_jumped = active
        return self._imu.sample(state)


class FaultySensor:
    """A sensor that measures nothing, or repeats its last values, while a fault lasts.

    The wrapped sensor keeps sampling: after the fault its noise is the same as without a fault.
    """

    def __init__(self, sensor: Sensor, fault: SensorFault):
        """Add a fault to a sensor.

        Args:
            sensor: the sensor.
            fault: the fault and its time.
        """
        self.latency = sensor.latency
        self._sensor = sensor
        self._fault = fault
        # the last measurement before the fault
        self._last: Measurement | None = None

    def sample(self, state: PlantState[State]) -> Measurement | None:
        """Return a measurement with the fault applied if one is due, else None."""
        measurement = self._sensor.sample(state)
        if measurement is None:
            return None
        if not self._fault.window.active(measurement.t):
            self._last = measurement
            return measurement
        if self._fault.effect == "lost" or self._last is None:
            return None
        return repeated(self._last, measurement, self._fault.sensor)


def with_jumps(imu: Imu, jumps: Sequence[BiasJump]) -> Imu | BiasedImu:
    """Return an inertial unit whose bias jumps."""
    biased: Imu | BiasedImu = imu
    for jump in jumps:
        biased = BiasedImu(biased, jump)
    return biased


def repeated(last: Measurement, now: Measurement, part: str) -> Measurement:
    """Return the present measurement with frozen values of an earlier one.

    Args:
        last: an earlier measurement of the same sensor.
        now: the present measurement, whose time is kept.
        part: the frozen part: the gyro or the accelerometer of an imu, or the whole sensor.
    """
    if isinstance(last, Inertial) and isinstance(now, Inertial):
        gyro = now.gyro if part == "accelerometer" else last.gyro
        force = now.specific_force if part == "gyro" else last.specific_force
        return Inertial(now.t, now.dt, gyro=gyro, specific_force=force)
    return replace(last, t=now.t)


class Coming(NamedTuple):
    """A measurement that has not arrived yet; instances sort by their time of arrival."""

    # time of arrival [s]
    t: float
    # number of the measurement, which orders simultaneous arrivals
    number: int
    measurement: Measurement


class Sensors:
    """The sensors of a flight, which sample its physics steps.

    Each sensor has its own random stream, so its noise does not depend on the other sensors.
    """

    def __init__(
        self,
        sensing: Sensing,
        seeds: np.random.SeedSequence,
        vehicle: Vehicle,
        gates: Sequence[Gate],
        velocity_lag: float = 0.0,
        obstacles: Sequence[Obstacle] = (),
        faults: Sequence[FaultOfSensor] = (),
        eye: Eye | None = None,
    ):
        """Make the sensors of a flight.

        Args:
            sensing: the set of sensors, with their parameters.
            seeds: the flight's random stream for sensors.
            vehicle: the true vehicle, as in the plant.
            gates: the distinct gates at their true positions.
            velocity_lag: time by which the plant's velocity lags [s], see
                quadsim.physics.plant.Plant.
            obstacles: obstacles on the course.
            faults: faults of these sensors, with their times.
            eye: function that renders the pictures of a pixel camera.
        """
        streams = sensor_streams(seeds)
        sensors: dict[str, Sensor] = {}
        if sensing.imu:
            jumps = [fault for fault in faults if isinstance(fault, BiasJump)]
            sensors["imu"] = with_jumps(Imu(sensing.imu, streams.imu), jumps)
        if sensing.rotors:
            sensors["rotors"] = RotorSpeeds(sensing.rotors, streams.rotors, vehicle)
        if sensing.pose:
            sensors["pose"] = PoseSensor(sensing.pose, streams.pose)
        if sensing.camera:
            sensors["camera"] = GateCamera(sensing.camera, streams.camera, gates, obstacles)
        if sensing.pixels:
            assert eye
            sensors["pixels"] = PixelCamera(sensing.pixels, eye, streams.camera)
        if sensing.barometer:
            sensors["barometer"] = Barometer(sensing.barometer, streams.barometer)
        for fault in faults:
            if isinstance(fault, SensorFault):
                key = sensor_key(fault)
                sensors[key] = FaultySensor(sensors[key], fault)
        self._sensors = tuple(sensors.values())
        self._velocity_lag = velocity_lag
        self._before: PlantState[State] | None = None
        # the last sampled state, with position and velocity at the same instant
        self.truth: PlantState[State] | None = None
        # a heap
        self._coming: list[Coming] = []
        self._number = count()

    def warm_up(self, state: PlantState[State], dt: float) -> None:
        """Sample the vehicle at rest for WARM_UP until just before the flight.

        Args:
            state: the first state of the flight.
            dt: physics step [s].
        """
        for k in range(-round(WARM_UP / dt), 0):
            self.observe(PlantState(k * dt, state.x, ()))

    def observe(self, state: PlantState[State]) -> None:
        """Sample the state after a physics step."""
        self.truth = self._of_one_instant(state)
        for sensor in self._sensors:
            measurement = sensor.sample(self.truth)
            if measurement is not None:
                arrival = measurement.t + sensor.latency
                heappush(self._coming, Coming(arrival, next(self._number), measurement))

    def _of_one_instant(self, state: PlantState[State]) -> PlantState[State]:
        """Return the state with its velocity extrapolated to the instant of its position.

        The extrapolation uses the acceleration of the last step.
        """
        before = self._before
        self._before = state
        if before is None or not self._velocity_lag:
            return state
        share = self._velocity_lag / (state.t - before.t)
        last = before.x
        x = state.x
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
        """Return the measurements that have arrived since the last call, in order of arrival.

        Args:
            t: time now [s].
        """
        found = []
        while self._coming and self._coming[0].t <= t + 1e-9:
            found.append(heappop(self._coming).measurement)
        return found
