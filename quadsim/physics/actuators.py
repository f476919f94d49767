"""Actuators: from a command to the wrench on the rigid body, the same for every plant.

limits -> latency -> rate loop -> allocation with priorities -> rotor lag -> wrench and drag.
Vehicles without rotors skip allocation and lag: their thrust and torque act at once.
Scalars and tuples throughout: at 400 Hz the overhead of 3-element arrays would be most of the cost.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import isfinite

from quadsim.dynamics.first_order import remaining, response
from quadsim.dynamics.quadrotor import Control
from quadsim.physics.allocation import PerRotor, allocate, mixer, shares
from quadsim.rotation import Vec3
from quadsim.vehicle import GRAVITY, Rotors, Vehicle

HOVER = Control(wx=0.0, wy=0.0, wz=0.0, thrust=GRAVITY)


def clamp_command(command: Sequence[float], vehicle: Vehicle) -> Control:
    """Return the command with body rates within +-rate_max and thrust within [0, thrust_max].

    Raises ValueError if a number is not finite. command: in the order of Control.
    """
    # a float32 would make all that follows single precision
    wx, wy, wz, thrust = map(float, command)
    if not all(map(isfinite, (wx, wy, wz, thrust))):
        raise ValueError(
            f"command: expected finite body rates [rad/s] and thrust [m/s^2], got {wx, wy, wz, thrust}"
        )
    mx, my, mz = vehicle.rate_max
    return Control(
        min(max(wx, -mx), mx),
        min(max(wy, -my), my),
        min(max(wz, -mz), mz),
        min(max(thrust, 0.0), vehicle.thrust_max),
    )


def rate_torque(omega: Vec3, omega_cmd: Vec3, gain: Vec3, inertia: Vec3) -> Vec3:
    """J K (omega_cmd - omega) + omega x J omega [N m].

    With K = (1 - exp(-dt/tau)) / dt an explicit Euler step of dt lands exactly on the first-order
    response, 63 % at tau for any dt. The second term cancels the gyroscopic one that the body's own
    dynamics contain.
    """
    wx, wy, wz = omega
    wx_cmd, wy_cmd, wz_cmd = omega_cmd
    kx, ky, kz = gain
    jx, jy, jz = inertia
    gx, gy, gz = gyroscopic(omega, inertia)
    return (
        jx * ((wx_cmd - wx) * kx) + gx,
        jy * ((wy_cmd - wy) * ky) + gy,
        jz * ((wz_cmd - wz) * kz) + gz,
    )


def gyroscopic(omega: Vec3, inertia: Vec3) -> Vec3:
    """omega x J omega [N m], for principal moments J [kg m^2]."""
    p, q, r = omega
    jx, jy, jz = inertia
    return (jz - jy) * q * r, (jx - jz) * r * p, (jy - jx) * p * q


def angular_acceleration(omega: Vec3, torque: Vec3, inertia: Vec3) -> Vec3:
    """J^-1 (tau - omega x J omega) [rad/s^2]: Euler's equation of a rigid body, in its own
    frame."""
    tx, ty, tz = torque
    gx, gy, gz = gyroscopic(omega, inertia)
    jx, jy, jz = inertia
    return (tx - gx) / jx, (ty - gy) / jy, (tz - gz) / jz


class Motors:
    """Four rotors whose speeds follow their commands first-order in tau. They start at hover."""

    def __init__(self, vehicle: Vehicle, rotors: Rotors, dt: float):
        self._rotors, self._mixer, self._share = rotors, mixer(rotors), shares(rotors)
        # a fitted map may go below zero at idle
        self._low = max(0.0, rotors.thrust(rotors.omega_min))
        self._high = rotors.thrust(rotors.omega_max)
        self._remaining = remaining(rotors.tau, dt)
        self.speeds: PerRotor = (rotors.speed(0.25 * vehicle.mass * GRAVITY),) * 4  # [rad/s]

    def drive(self, collective: float, torque: Vec3) -> tuple[float, Vec3]:
        """One step towards the demand: the collective [N] and torque [N m] delivered at its end."""
        commands = map(
            self._rotors.speed, allocate(self._share, collective, torque, self._low, self._high)
        )
        self.speeds = tuple(
            c + (w - c) * self._remaining for w, c in zip(self.speeds, commands, strict=True)
        )
        t0, t1, t2, t3 = map(self._rotors.thrust, self.speeds)
        force, x, y, z = (a * t0 + b * t1 + c * t2 + d * t3 for a, b, c, d in self._mixer)
        return force, (x, y, z)


class Actuators:
    """One vehicle's actuators, stepped every dt [s]. Their state: commands within the latency,
    rotor speeds."""

    def __init__(self, vehicle: Vehicle, dt: float):
        self._vehicle = vehicle
        tau_x, tau_y, tau_z = vehicle.rate_tau
        # [1/s]
        self._gain = response(tau_x, dt) / dt, response(tau_y, dt) / dt, response(tau_z, dt) / dt
        self._delayed: deque[Control] = deque([HOVER] * round(vehicle.latency / dt))
        self.motors = Motors(vehicle, vehicle.rotors, dt) if vehicle.rotors else None
        self.thrust = GRAVITY  # delivered, mass-normalised, along body z [m/s^2]
        self.angular_acceleration: Vec3 = (0.0, 0.0, 0.0)  # delivered, body frame [rad/s^2]

    def wrench(self, command: Sequence[float], omega_body: Vec3, v_body: Vec3) -> tuple[Vec3, Vec3]:
        """(force [N], torque [N m]) in the body frame for the step that starts now.

        command: in the order of Control. Drag is linear, -m d v per body axis.
        """
        vehicle = self._vehicle
        self._delayed.append(clamp_command(command, vehicle))
        acting = self._delayed.popleft()
        torque = rate_torque(omega_body, acting.body_rates, self._gain, vehicle.inertia)
        force = vehicle.mass * acting.thrust
        if self.motors:
            force, torque = self.motors.drive(force, torque)
        self.thrust = force / vehicle.mass
        self.angular_acceleration = angular_acceleration(omega_body, torque, vehicle.inertia)
        dx, dy, dz = vehicle.drag
        vx, vy, vz = v_body
        drag = -vehicle.mass * dx * vx, -vehicle.mass * dy * vy, -vehicle.mass * dz * vz
        return (drag[0], drag[1], drag[2] + force), torque
