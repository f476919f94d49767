"""Actuators: the map from a command to the wrench on the rigid body, common to all plants.

    limits -> link and latency -> rate loop -> allocation with priorities -> rotor lag
    -> wrench and drag

Faults of the vehicle change the rate loop, the rotors and the wrench, see `Condition`.

Vehicles without rotors skip allocation and lag: their thrust and torque act at once. The code uses
scalars and tuples: at 400 Hz the overhead of 3-element arrays would dominate the cost.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, prod
from typing import NamedTuple

from quadsim.dynamics.allocation import PerRotor
from quadsim.dynamics.first_order import response
from quadsim.dynamics.quadrotor import Control
from quadsim.dynamics.rate_torque import gyroscopic, rate_torque
from quadsim.dynamics.rotors import SOUND, Motors, RotorHealth
from quadsim.physics.faults import (
    ROTORS,
    VECTORS,
    FactorFault,
    FactorPart,
    FaultOfVehicle,
    RotorFault,
    RotorPart,
    VectorFault,
    VectorPart,
)
from quadsim.physics.link import Link
from quadsim.physics.plant_state import MotorUse
from quadsim.rotation import Quaternion, Vec3
from quadsim.vehicle import GRAVITY, Vehicle


class Wrench(NamedTuple):
    """A force [N] and a torque [N m] on the body, in the body frame."""

    force: Vec3
    torque: Vec3


def clamp_command(command: Sequence[float], vehicle: Vehicle) -> Control:
    """Return the command with body rates within +-rate_max and thrust within [0, thrust_max].

    Args:
        command: command in the order of Control  (4,).
        vehicle: vehicle with the limits.

    Raises:
        ValueError: a number of the command is not finite.
    """
    # A float32 would make all later arithmetic single precision.
    wx, wy, wz, thrust = map(float, command)
    if not all(map(isfinite, (wx, wy, wz, thrust))):
        raise ValueError(
            "command: expected finite body rates [rad/s] and thrust [m/s^2], "
            f"got {wx, wy, wz, thrust}"
        )
    mx, my, mz = vehicle.omega_max
    return Control(
        wx=min(max(wx, -mx), mx),
        wy=min(max(wy, -my), my),
        wz=min(max(wz, -mz), mz),
        thrust=min(max(thrust, 0.0), vehicle.thrust_max),
    )


def angular_acceleration(omega: Vec3, torque: Vec3, inertia: Vec3) -> Vec3:
    """Return J^-1 (tau - omega x J omega) [rad/s^2], Euler's equation in the body frame."""
    tx, ty, tz = torque
    gx, gy, gz = gyroscopic(omega, inertia)
    jx, jy, jz = inertia
    return (tx - gx) / jx, (ty - gy) / jy, (tz - gz) / jz


def drag_force(vehicle: Vehicle, v_body: Vec3) -> Vec3:
    """Return the drag -m d v [N] in the body's axes, linear in the velocity along each axis.

    Args:
        vehicle: vehicle with the coefficients d [1/s].
        v_body: velocity in the body's axes [m/s].
    """
    dx, dy, dz = vehicle.drag
    vx, vy, vz = v_body
    return -vehicle.mass * dx * vx, -vehicle.mass * dy * vy, -vehicle.mass * dz * vz


class Condition(NamedTuple):
    """The condition of a vehicle with faults."""

    rotors: RotorHealth = SOUND
    # factor on the gains of the rate loop
    rate_gain: float = 1.0
    # factor on the mass of the body
    mass: float = 1.0
    # torque that is always there [N m]
    torque: Vec3 = (0.0, 0.0, 0.0)
    # place of the centre of mass, along x and y of the body [m]
    centre: tuple[float, float] = (0.0, 0.0)

    def on_body(self, force: float, torque: Vec3, drag: Vec3) -> Wrench:
        """Return the wrench on a body of the nominal mass that moves it as a body of this mass.

        Args:
            force: thrust of the rotors [N].
            torque: torque of the rotors about their centre [N m].
            drag: drag, in the body frame [N].
        """
        x, y, z = torque
        mx, my, mz = self.torque
        cx, cy = self.centre
        dx, dy, dz = drag
        return Wrench(
            force=(dx / self.mass, dy / self.mass, (dz + force) / self.mass),
            torque=(x + mx - cy * force, y + my + cx * force, z + mz),
        )


INTACT = Condition()


def condition_at(t: float, faults: Sequence[FaultOfVehicle]) -> Condition:
    """Return the condition of a vehicle at the time t [s].

    The factors of several faults multiply, torques and displacements add up.
    """
    active = [fault for fault in faults if fault.window.active(t)]
    if not active:
        return INTACT

    def on_rotors(part: RotorPart) -> PerRotor:
        """Return the factors on a number of each rotor."""
        of_part = [one for one in active if isinstance(one, RotorFault) and one.part == part]
        return tuple(
            prod(fault.factor for fault in of_part if fault.rotor == rotor)
            for rotor in range(1, ROTORS + 1)
        )

    def on_vehicle(part: FactorPart) -> float:
        """Return the factor on a number of the vehicle."""
        of_part = [one for one in active if isinstance(one, FactorFault) and one.part == part]
        return prod(fault.factor for fault in of_part)

    def added(part: VectorPart) -> tuple[float, ...]:
        """Return the sum of the vectors of a part."""
        of_part = [one for one in active if isinstance(one, VectorFault) and one.part == part]
        vectors = [fault.vector for fault in of_part] or [(0.0,) * VECTORS[part].size]
        return tuple(map(sum, zip(*vectors, strict=True)))

    thrust = on_vehicle("thrust")
    strengths = tuple(thrust * strength for strength in on_rotors("rotor"))
    x, y, z = added("torque")
    cx, cy = added("centre")
    return Condition(
        rotors=RotorHealth(strengths, on_rotors("motor"), on_vehicle("battery")),
        rate_gain=on_vehicle("rate_gain"),
        mass=on_vehicle("mass"),
        torque=(x, y, z),
        centre=(cx, cy),
    )


class Actuators:
    """The actuators of one vehicle, stepped every dt [s].

    The state consists of the commands on the link, the rotor speeds, and the time, which decides
    which faults are active.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        dt: float,
        faults: Sequence[FaultOfVehicle] = (),
        link: Link | None = None,
    ):
        """Begin at t = 0, hovering.

        Args:
            vehicle: vehicle that has the actuators.
            dt: physics step [s].
            faults: faults of the vehicle, whose random numbers have been drawn.
            link: link that carries the commands; None: a wire without losses.
        """
        self._vehicle = vehicle
        self._dt = dt
        self._steps = 0
        self._faults = faults
        tau_x, tau_y, tau_z = vehicle.rate_tau
        # gains of the rate loop [1/s]
        self._gain = (response(tau_x, dt) / dt, response(tau_y, dt) / dt, response(tau_z, dt) / dt)
        # The derivative of the body rates is taken over the last step, as firmware does.
        self._lead: Vec3 | None = vehicle.rate_lead if any(vehicle.rate_lead) else None
        self._last_rates: Vec3 = (0.0, 0.0, 0.0)
        self._link = link or Link(dt, vehicle.latency)
        self.motors = Motors(vehicle, vehicle.rotors, dt) if vehicle.rotors else None
        # thrust delivered along body z, mass-normalised [m/s^2]
        self.thrust = GRAVITY
        # angular acceleration delivered, body frame [rad/s^2]
        self.angular_acceleration: Vec3 = (0.0, 0.0, 0.0)
        # None, as no firmware commands the motors
        self.use: MotorUse | None = None

    def wrench(
        self,
        command: Sequence[float],
        omega_body: Vec3,
        v_body: Vec3,
        attitude: Quaternion = (1.0, 0.0, 0.0, 0.0),
    ) -> Wrench:
        """Return the wrench on the body for the step that starts now.

        Args:
            command: present command in the order of Control  (4,).
            omega_body: body rates [rad/s].
            v_body: velocity in the body frame [m/s].
            attitude: wxyz, not used by ideal actuators.
        """
        vehicle = self._vehicle

        # The command that acts now was given one latency ago.
        acting = self._link.carry(clamp_command(command, vehicle)).command

        # The rate loop and the rotors turn it into force and torque.
        wanted = self._damped(acting.body_rates, omega_body) if self._lead else acting.body_rates
        condition = INTACT
        gain = self._gain
        if self._faults:
            condition = condition_at(self._steps * self._dt, self._faults)
            x, y, z = gain
            factor = condition.rate_gain
            gain = (factor * x, factor * y, factor * z)
        torque = rate_torque(omega_body, wanted, gain, vehicle.inertia)
        force = vehicle.mass * acting.thrust
        if self.motors:
            force, torque = self.motors.drive(force, torque, condition.rotors)
        self.thrust = force / vehicle.mass

        wrench = condition.on_body(force, torque, drag_force(vehicle, v_body))
        self.angular_acceleration = angular_acceleration(omega_body, wrench.torque, vehicle.inertia)
        self._steps += 1
        return wrench

    def _damped(self, commanded: Vec3, rates: Vec3) -> Vec3:
        """Return the commanded rates less the lead times the derivative of the rates [rad/s]."""
        assert self._lead
        lx, ly, lz = self._lead
        dt = self._dt
        wx, wy, wz = commanded
        p, q, r = rates
        last_p, last_q, last_r = self._last_rates
        self._last_rates = rates
        return (
            wx - lx * (p - last_p) / dt,
            wy - ly * (q - last_q) / dt,
            wz - lz * (r - last_r) / dt,
        )

    def close(self) -> None:
        """Do nothing, as there are no resources to release."""
