"""Vehicle: the numbers of one quadrotor as plain values; see vehicle_file for the YAML they are
read from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

from quadsim.rotation import Vec3

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Rotors:
    """Four rotors: front-right, back-left, front-left, back-right; see `spin`."""

    positions: tuple[tuple[float, float], ...]  # (4, 2) body x, y [m]
    spin: tuple[int, ...]  # (4,) sign of the reaction torque about body z
    thrust_map: Vec3  # c2 [N s^2], c1 [N s], c0 [N]
    omega_min: float  # [rad/s]
    omega_max: float  # [rad/s]
    tau: float  # first-order lag of the rotor speed [s]
    kappa: float  # reaction torque per thrust [m]

    def thrust(self, speed: float) -> float:
        """c2 W^2 + c1 W + c0 of one rotor [N] at the speed W [rad/s]."""
        c2, c1, c0 = self.thrust_map
        return (c2 * speed + c1) * speed + c0

    def speed(self, thrust: float) -> float:
        """The speed [rad/s] at which one rotor gives this thrust [N], on the rising branch of the
        thrust map."""
        c2, c1, c0 = self.thrust_map
        return (sqrt(c1 * c1 + 4.0 * c2 * (thrust - c0)) - c1) / (2.0 * c2)


@dataclass(frozen=True)
class Vehicle:
    """What the plant flies. Thrusts and drag are mass-normalised, so that `paper` needs no mass of
    its own."""

    name: str
    source: str
    mass: float  # [kg]
    inertia: Vec3  # principal moments [kg m^2]
    radius: float  # of the sphere that stands for it in contacts [m]
    rate_tau: Vec3  # first-order rate loop, per axis [s]
    rate_max: Vec3  # body-rate command limit [rad/s]
    thrust_max: float  # collective, mass-normalised [m/s^2]
    drag: Vec3  # linear, body frame [1/s]
    latency: float  # command to actuator [s]
    rotors: Rotors | None  # None: thrust acts at once and without per-rotor limits


def scale_thrust(vehicle: Vehicle, factor: float) -> Vehicle:
    """Stronger or weaker propellers: thrust map and limit times the factor, mass and rotor speeds
    as they were."""
    rotors = vehicle.rotors
    if rotors:
        c2, c1, c0 = rotors.thrust_map
        rotors = replace(rotors, thrust_map=(c2 * factor, c1 * factor, c0 * factor))
    return replace(vehicle, thrust_max=vehicle.thrust_max * factor, rotors=rotors)


def with_thrust_to_weight(vehicle: Vehicle, ratio: float) -> Vehicle:
    """The vehicle with full thrust of `ratio` times its weight, and a name that says so."""
    scaled = scale_thrust(vehicle, ratio * GRAVITY / vehicle.thrust_max)
    return replace(scaled, name=f"{vehicle.name}-twr{ratio:g}")
