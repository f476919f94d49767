"""Actuators with Betaflight between command and rotors.

    limits -> link and latency -> firmware -> rotor lag -> wrench and drag

The firmware replaces the rate loop and the allocation of quadsim.physics.actuators. Its inputs are
gyro, accelerometer and attitude of the vehicle, and the stick positions that give a command under
its configuration; its outputs are the commands of the four motors. A motor's command is a share of
the rotor's full speed.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.random import SeedSequence, default_rng

from quadsim.dynamics.allocation import PerRotor
from quadsim.dynamics.quadrotor import Control
from quadsim.dynamics.rotors import Motors
from quadsim.files.atomic import replace_file
from quadsim.firmware.configuration import AXES, BOOT, THROTTLE, Configuration, expect_armed
from quadsim.firmware.package import Built
from quadsim.firmware.process import LOW, Firmware, FirmwareError
from quadsim.firmware.switches import FIRST_AUX
from quadsim.physics.actuators import (
    Wrench,
    angular_acceleration,
    clamp_command,
    condition_at,
    drag_force,
)
from quadsim.physics.faults import FaultOfVehicle
from quadsim.physics.link import HOVER, Link
from quadsim.physics.plant_state import MotorUse
from quadsim.rotation import Quaternion, Vec3
from quadsim.vehicle import GRAVITY, Vehicle

# Betaflight's motor numbers, from 0, of the rotors front right, back left, front left, back right
MOTOR_OF_ROTOR = (1, 2, 3, 0)
LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
STILL: Vec3 = (0.0, 0.0, 0.0)
LOGS = "LOG*.BF*"  # the firmware's logs in its folder; it cuts the last letter of the name
LOG_END = 0.2  # time after which the firmware has closed its log [s]
# Time between arming and the start of the flight, of which the second half is at hover thrust [s]
READY = 1.0
# Command from which a motor counts as saturated
FULL = 0.999


def motors_reversed(vehicle: Vehicle) -> bool:
    """Return whether the propellers turn opposite to Betaflight's default.

    By default the front right motor turns counterclockwise, seen from above, so that its reaction
    torque turns the vehicle clockwise: about -z.
    """
    assert vehicle.rotors
    return vehicle.rotors.spin[0] > 0


class FirmwareLog(NamedTuple):
    """The file of the firmware's own log of a flight."""

    path: Path
    eeprom: bytes  # the configuration with the log switched on


class ImuNoise(NamedTuple):
    """The white noise of the firmware's gyroscope and accelerometer in each physics step."""

    gyro: float  # standard deviation [rad/s]
    accelerometer: float  # standard deviation [m/s^2]
    stream: SeedSequence


class BetaflightActuators:
    """The actuators of one vehicle behind a process of the firmware, stepped every dt [s]."""

    def __init__(
        self,
        vehicle: Vehicle,
        dt: float,
        built: Built,
        configuration: Configuration,
        faults: Sequence[FaultOfVehicle] = (),
        link: Link | None = None,
        log: FirmwareLog | None = None,
        noise: ImuNoise | None = None,
    ):
        """Start the firmware, arm it, and hover.

        Args:
            vehicle: vehicle with rotors.
            dt: physics step [s], which is the period of the lock step.
            built: the firmware.
            configuration: configuration of the firmware, for the direction of this vehicle's
                motors.
            faults: faults of the vehicle, with nothing left to draw.
            link: link for the commands; None: a wire.
            log: file of the firmware's own log; None: no log.
            noise: noise of its inertial measurement unit; None: exact measurements. Biases are left
                out, as the firmware removes them by calibration at rest.

        Raises:
            FirmwareError: the firmware does not arm.
        """
        assert vehicle.rotors
        self._vehicle = vehicle
        self._rotors = vehicle.rotors
        self._dt = dt
        self._steps = 0
        self._faults = faults
        self._configuration = configuration
        self._link = link or Link(dt, vehicle.latency)
        self.motors = Motors(vehicle, vehicle.rotors, dt)
        self.thrust = GRAVITY
        self.angular_acceleration: Vec3 = STILL
        # specific force in the body frame [m/s^2]
        self._specific_force: Vec3 = (0.0, 0.0, GRAVITY)
        self._channels = configuration.switches.channels()
        self._log = log
        self._noise_std = np.zeros(6)
        self._random = None
        if noise:
            self._noise_std = np.repeat([noise.gyro, noise.accelerometer], 3)
            self._random = default_rng(noise.stream)
        eeprom = log.eeprom if log else configuration.eeprom
        self._firmware = Firmware(built.program, dt, eeprom)
        self._get_ready()
        self.use = MotorUse()
        self._commanded = HOVER
        self._motors_before = self._firmware.reply.motors

    def _get_ready(self) -> None:
        """Arm the firmware, and hold the hover sticks until its filters have settled."""
        standing = (STILL, self._specific_force, LEVEL)
        every = self._link.frame_steps
        self._firmware.step(*standing, self._channels, round(BOOT / self._dt), every)
        self._channels[FIRST_AUX:] = self._configuration.switches.flight
        half = round(0.5 * READY / self._dt)
        expect_armed(self._firmware.step(*standing, self._channels, half, every))
        self._set_sticks(HOVER)
        expect_armed(self._firmware.step(*standing, self._channels, half, every))

    def wrench(
        self,
        command: Sequence[float],
        omega_body: Vec3,
        v_body: Vec3,
        attitude: Quaternion = LEVEL,
    ) -> Wrench:
        """Return the wrench on the body for the step that starts now.

        Args:
            command: present command in the order of Control  (4,).
            omega_body: body rates [rad/s].
            v_body: velocity in the body frame [m/s].
            attitude: wxyz.

        Raises:
            FirmwareError: the firmware has ended.
        """
        vehicle = self._vehicle

        # A frame of the link moves the sticks.
        received = self._link.carry(clamp_command(command, vehicle))
        if received.is_new:
            self._set_sticks(received.command)
            self._commanded = received.command

        # The firmware commands the motors, which the rotors follow.
        gyro, specific_force = self._measured(omega_body)
        reply = self._firmware.step(
            gyro,
            specific_force,
            attitude,
            self._channels,
            frame_every=1 if received.is_new else 0,
        )
        self.use = self._use_after(reply.motors)
        condition = condition_at(self._steps * self._dt, self._faults)
        full = condition.rotors.top_speed * self._rotors.motor_omega_max
        speeds = (reply.motors[motor] * full for motor in MOTOR_OF_ROTOR)
        force, torque = self.motors.follow(speeds, condition.rotors)
        self.thrust = force / vehicle.mass

        wrench = condition.on_body(force, torque, drag_force(vehicle, v_body))
        self.angular_acceleration = angular_acceleration(omega_body, wrench.torque, vehicle.inertia)
        fx, fy, fz = wrench.force
        self._specific_force = (fx / vehicle.mass, fy / vehicle.mass, fz / vehicle.mass)
        self._steps += 1
        return wrench

    def _use_after(self, motors: PerRotor) -> MotorUse:
        """Return the use of the motors after a step with these commands, 1 at full speed."""
        changes = (
            abs(now - before) for now, before in zip(motors, self._motors_before, strict=True)
        )
        variation = self.use.motor_variation + sum(changes) / len(motors)
        self._motors_before = motors

        lost = self.use.thrust_lost
        if max(motors) >= FULL:
            forces = (self._rotors.thrust(motor * self._rotors.motor_omega_max) for motor in motors)
            missing = self._commanded.thrust - sum(forces) / self._vehicle.mass
            lost += max(0.0, missing) * self._dt
        return MotorUse(variation, lost)

    def _measured(self, omega_body: Vec3) -> tuple[Vec3, Vec3]:
        """Return the measured body rates [rad/s] and specific force [m/s^2] of the firmware."""
        if self._random is None:
            return omega_body, self._specific_force
        exact = np.array((*omega_body, *self._specific_force))
        noise = self._noise_std * self._random.standard_normal(6)
        wx, wy, wz, fx, fy, fz = (exact + noise).tolist()
        return (wx, wy, wz), (fx, fy, fz)

    def close(self) -> None:
        """End the firmware, and keep its log.

        Raises:
            FirmwareError: the log cannot be written.
        """
        try:
            if self._log:
                self._keep_log(self._log.path)
        finally:
            self._firmware.close()

    def _keep_log(self, path: Path) -> None:
        """Disarm, so that the firmware closes its log, and keep the log. Raises FirmwareError."""
        self._channels[FIRST_AUX:] = self._configuration.switches.idle
        standing = (STILL, self._specific_force, LEVEL)
        with suppress(FirmwareError):  # the firmware has ended and closed its log
            self._firmware.step(*standing, self._channels, round(LOG_END / self._dt))
        logs = sorted(self._firmware.folder.glob(LOGS))
        if not logs:
            raise FirmwareError(f"{path}: expected a log of the firmware, but it has written none")
        try:
            replace_file(path, logs[-1].read_bytes())
        except OSError as error:
            raise FirmwareError(f"{path}: cannot be written: {error.strerror}") from None

    def _set_sticks(self, command: Control) -> None:
        """Set the channels of the sticks for a command."""
        configuration = self._configuration
        for axis, rate in enumerate(command.body_rates):
            self._channels[AXES[axis]] = configuration.pulse_for_rate(axis, rate)
        self._channels[THROTTLE] = self._throttle(command.thrust)

    def _throttle(self, thrust: float) -> float:
        """Return the pulse [us] at which the rotors give a thrust [m/s^2]."""
        of_each = 0.25 * self._vehicle.mass * thrust
        lowest = self._rotors.thrust(0.0)
        if of_each <= lowest:
            return LOW
        return self._configuration.pulse_for_motors(
            self._rotors.speed(of_each) / self._rotors.motor_omega_max
        )
