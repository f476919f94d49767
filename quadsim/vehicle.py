"""Vehicle: the numbers of one quadrotor, read from `vehicles/*.yaml` with Flightmare's key names."""

from __future__ import annotations

from dataclasses import dataclass

Vec3 = tuple[float, float, float]
GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Rotors:
    """Four rotors: front-right, back-left, front-left, back-right would be positions[0..3]; see `spin`."""

    positions: tuple[tuple[float, float], ...]  # (4, 2) body x, y [m]
    spin: tuple[int, ...]  # (4,) sign of the reaction torque about body z
    thrust_map: Vec3  # T(W) = c2 W^2 + c1 W + c0 [N], W in rad/s
    omega_min: float  # [rad/s]
    omega_max: float  # [rad/s]
    tau: float  # first-order lag of the rotor speed [s]
    kappa: float  # reaction torque per thrust [m]


@dataclass(frozen=True)
class Vehicle:
    """What the plant *is*. Thrusts and drag are mass-normalised, so `paper` needs no mass at all."""

    name: str
    source: str
    mass: float  # [kg]
    inertia: Vec3  # principal moments [kg m^2]
    radius: float  # of the sphere that collides and is judged [m]
    rate_tau: Vec3  # first-order rate loop, per axis [s]
    rate_max: Vec3  # body-rate command limit [rad/s]
    thrust_max: float  # collective, mass-normalised [m/s^2]
    drag: Vec3  # linear, body frame [1/s]
    latency: float  # command to actuator [s]
    rotors: Rotors | None  # None: thrust acts at once and without per-rotor limits
