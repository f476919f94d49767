"""Actuators: what stands between a command and a wrench on the rigid body. No physics engine here.

command -> latency -> limits -> rate loop -> allocation with priorities -> rotor lag -> wrench + drag.
Vehicles without rotors skip allocation and lag: their thrust and torque act at once.
Scalars and tuples throughout: at 400 Hz the overhead of 3-element arrays would be most of the cost.
"""

from __future__ import annotations

from collections import deque
from math import exp, isfinite, sqrt

import numpy as np

from quadsim.vehicle import GRAVITY, Rotors, Vehicle

Vector = tuple[float, ...]  # 3 numbers in space, 4 where it is a quaternion, a command or rotors
HOVER: Vector = (0.0, 0.0, 0.0, GRAVITY)


def to_body(q: Vector, v: Vector) -> Vector:
    """R(q)^T v = v - w t + u x t with t = 2 u x v, for q = (w, u) world from body."""
    w, ux, uy, uz = q
    x, y, z = v
    tx, ty, tz = 2.0 * (uy * z - uz * y), 2.0 * (uz * x - ux * z), 2.0 * (ux * y - uy * x)
    return x - w * tx + uy * tz - uz * ty, y - w * ty + uz * tx - ux * tz, z - w * tz + ux * ty - uy * tx


def decay(tau: float, dt: float) -> float:
    """exp(-dt / tau): the share of a first-order error left after dt; none for tau = 0."""
    return exp(-dt / tau) if tau > 0.0 else 0.0


def clamp_command(command: Vector, vehicle: Vehicle) -> Vector:
    """Body rates within +-rate_max, thrust within [0, thrust_max]. ValueError if a number is not finite."""
    wx, wy, wz, thrust = map(float, command)  # a float32 would drag all that follows down to its precision
    if not all(map(isfinite, (wx, wy, wz, thrust))):
        raise ValueError(f"command: expected finite body rates [rad/s] and thrust [m/s^2], got {wx, wy, wz, thrust}")
    mx, my, mz = vehicle.rate_max
    return (
        min(max(wx, -mx), mx),
        min(max(wy, -my), my),
        min(max(wz, -mz), mz),
        min(max(thrust, 0.0), vehicle.thrust_max),
    )


def rate_torque(omega: Vector, omega_cmd: Vector, gain: Vector, inertia: Vector) -> Vector:
    """J K (omega_cmd - omega) + omega x J omega [N m].

    With K = (1 - exp(-dt/tau)) / dt an explicit Euler step of dt lands exactly on the first-order response,
    63 % at tau for any dt. The second term cancels the gyroscopic one that the body's own dynamics contain.
    """
    (p, q, r), (jx, jy, jz) = omega, inertia
    kx, ky, kz = ((c - w) * k for c, w, k in zip(omega_cmd, omega, gain, strict=True))
    return jx * kx + (jz - jy) * q * r, jy * ky + (jx - jz) * r * p, jz * kz + (jy - jx) * p * q


def mixer(rotors: Rotors) -> tuple[Vector, ...]:
    """(collective, torque x, y, z) = mixer @ rotor thrusts.  (4, 4), [N, N m]"""
    spin = tuple(s * rotors.kappa for s in rotors.spin)
    xs, ys = zip(*rotors.positions, strict=True)
    return (1.0, 1.0, 1.0, 1.0), ys, tuple(-x for x in xs), spin


def shares(rotors: Rotors) -> tuple[Vector, ...]:
    """Inverse of the mixer: row i gives rotor i's part of (collective, torque x, y, z).  (4, 4)

    ValueError unless each rotor carries a quarter of the collective, which `saturate` builds on.
    """
    matrix = np.array(mixer(rotors))
    inverse = np.linalg.pinv(matrix)
    if not np.allclose(matrix @ inverse, np.eye(4)) or not np.allclose(inverse[:, 0], 0.25):
        raise ValueError(
            "rotors: expected four, mirrored about the centre of mass [m], diagonal pairs of equal spin, "
            f"got positions {rotors.positions}, spin {rotors.spin}"
        )
    return tuple(map(tuple, inverse.tolist()))


def allocate(share: tuple[Vector, ...], collective: float, torque: Vector, low: float, high: float) -> Vector:
    """Rotor thrusts [N] in [low, high] for a collective [N] and a torque [N m], roll and pitch served first."""
    x, y, z = torque
    tilt = tuple(s[1] * x + s[2] * y for s in share)
    twist = tuple(s[3] * z for s in share)
    return saturate(tilt, 0.25 * collective, twist, low, high)


def saturate(tilt: Vector, lift: float, twist: Vector, low: float, high: float) -> Vector:
    """tilt + lift + twist within [low, high] per rotor: roll and pitch first, then collective, yaw last.

    Yaw is given up first; then the collective moves up or down to make room; only a roll and pitch demand
    wider than the whole range is scaled, its direction kept. The order is that of Smeur, Hoeppener and
    De Wagter, "Prioritized Control Allocation for Quadrotors Subject to Saturation", IMAV 2017: tilt targets
    the thrust, yaw does not.
    """
    spread = max(tilt) - min(tilt)
    scale = (high - low) / spread if spread > high - low else 1.0
    tilt = tuple(scale * r for r in tilt)
    lift = min(max(lift, low - min(tilt)), high - max(tilt))
    base = [lift + r for r in tilt]
    room = min([1.0, *(((high if t > 0.0 else low) - b) / t for b, t in zip(base, twist, strict=True) if t != 0.0)])
    room = max(room, 0.0)  # rounding may leave a base a hair outside the range
    return tuple(min(max(b + room * t, low), high) for b, t in zip(base, twist, strict=True))


def rotor_thrust(speed: float, thrust_map: Vector) -> float:
    """c2 W^2 + c1 W + c0 [N], W in [rad/s]."""
    c2, c1, c0 = thrust_map
    return (c2 * speed + c1) * speed + c0


def rotor_speed(thrust: float, thrust_map: Vector) -> float:
    """The rising branch of the inverse thrust map [rad/s]."""
    c2, c1, c0 = thrust_map
    return (sqrt(c1 * c1 + 4.0 * c2 * (thrust - c0)) - c1) / (2.0 * c2)


class Motors:
    """Four rotors whose speeds follow their commands first-order in tau. They start at hover."""

    def __init__(self, vehicle: Vehicle, rotors: Rotors, dt: float):
        map_ = rotors.thrust_map
        self._map, self._mixer, self._share = map_, mixer(rotors), shares(rotors)
        self._low = max(0.0, rotor_thrust(rotors.omega_min, map_))  # a fitted map may go below zero at idle
        self._high = rotor_thrust(rotors.omega_max, map_)
        self._left = decay(rotors.tau, dt)
        self.speeds = (rotor_speed(0.25 * vehicle.mass * GRAVITY, map_),) * 4  # [rad/s]

    def drive(self, collective: float, torque: Vector) -> tuple[float, Vector]:
        """One step towards the demand: the collective [N] and torque [N m] delivered at its end."""
        wanted = allocate(self._share, collective, torque, self._low, self._high)
        goals = (rotor_speed(thrust, self._map) for thrust in wanted)
        self.speeds = tuple(goal + (w - goal) * self._left for w, goal in zip(self.speeds, goals, strict=True))
        t0, t1, t2, t3 = (rotor_thrust(w, self._map) for w in self.speeds)
        force, *delivered = (a * t0 + b * t1 + c * t2 + d * t3 for a, b, c, d in self._mixer)
        return force, tuple(delivered)


class Actuators:
    """One vehicle's command path, stepped every dt [s]. Its memory: commands on their way, rotor speeds."""

    def __init__(self, vehicle: Vehicle, dt: float):
        self._vehicle = vehicle
        self._gain = tuple((1.0 - decay(tau, dt)) / dt for tau in vehicle.rate_tau)  # [1/s]
        self._underway = deque([HOVER] * round(vehicle.latency / dt))
        self.motors = Motors(vehicle, vehicle.rotors, dt) if vehicle.rotors else None
        self.thrust = GRAVITY  # delivered, mass-normalised, along body z [m/s^2]
        self.angular_acceleration: Vector = (0.0, 0.0, 0.0)  # delivered, body frame [rad/s^2]

    def wrench(self, command: Vector, omega_body: Vector, v_body: Vector) -> tuple[Vector, Vector]:
        """(force [N], torque [N m]) in the body frame for the step that starts now.

        command: body rates [rad/s] and mass-normalised thrust [m/s^2]. Drag is linear, -m d v per body axis.
        """
        vehicle = self._vehicle
        self._underway.append(clamp_command(command, vehicle))
        *omega_cmd, thrust = self._underway.popleft()
        torque = rate_torque(omega_body, tuple(omega_cmd), self._gain, vehicle.inertia)
        force = vehicle.mass * thrust
        if self.motors:
            force, torque = self.motors.drive(force, torque)
        self.thrust = force / vehicle.mass
        gyroscopic = rate_torque(omega_body, omega_body, self._gain, vehicle.inertia)
        self.angular_acceleration = tuple(
            (t - g) / j for t, g, j in zip(torque, gyroscopic, vehicle.inertia, strict=True)
        )
        fx, fy, fz = (-vehicle.mass * d * v for d, v in zip(vehicle.drag, v_body, strict=True))
        return (fx, fy, fz + force), torque
