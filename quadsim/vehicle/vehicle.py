"""Vehicle: the numbers of one quadrotor as plain values.

They are read from YAML by quadsim.vehicle.vehicle_file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

from quadsim.rotation import Vec3

GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Rotors:
    """Four rotors: front-right, back-left, front-left, back-right.

    Examples:
        >>> import quadsim
        >>> rotors = quadsim.load_vehicle("swift").rotors
        >>> speed = rotors.speed(2.0)  # of a rotor that gives 2 N [rad/s]
        >>> round(rotors.thrust(speed), 6)
        2.0
    """

    # x, y in the body frame [m]  (4, 2)
    positions: tuple[tuple[float, float], ...]
    # sign of the reaction torque about body z  (4,)
    spin: tuple[int, ...]
    # c2 [N s^2], c1 [N s], c0 [N]
    thrust_map: Vec3
    # limits of the speed [rad/s]
    omega_min: float
    omega_max: float
    # first-order lag of the speed [s]
    tau: float
    # reaction torque per thrust [m]
    kappa: float

    def thrust(self, speed: float) -> float:
        """Return c2 W^2 + c1 W + c0, the thrust of one rotor [N] at the speed W [rad/s]."""
        c2, c1, c0 = self.thrust_map
        return (c2 * speed + c1) * speed + c0

    def speed(self, thrust: float) -> float:
        """Return the speed [rad/s] at which one rotor gives a thrust [N].

        It lies on the rising branch of the thrust map.
        """
        c2, c1, c0 = self.thrust_map
        return (sqrt(c1 * c1 + 4.0 * c2 * (thrust - c0)) - c1) / (2.0 * c2)


@dataclass(frozen=True)
class Vehicle:
    """A quadrotor as the plant flies it.

    Thrusts and drag are mass-normalised, so that the vehicle `paper` needs no mass of its own.

    Examples:
        >>> from dataclasses import replace
        >>> import quadsim
        >>> swift = quadsim.load_vehicle("swift")
        >>> run = quadsim.fly("figure8", vehicle=replace(swift, mass=0.9), laps=1, samples=512)
        >>> run.outcome
        'finished'
    """

    name: str
    source: str
    # [kg]
    mass: float
    # principal moments [kg m^2]
    inertia: Vec3
    # radius of the sphere that stands for the vehicle in contacts [m]
    radius: float
    # lags of the first-order rate loop about x, y, z [s]
    rate_tau: Vec3
    # limits of the body-rate commands [rad/s]
    rate_max: Vec3
    # largest collective, mass-normalised [m/s^2]
    thrust_max: float
    # linear, body frame [1/s]
    drag: Vec3
    # from command to actuator [s]
    latency: float
    # None: thrust acts at once and without limits of single rotors
    rotors: Rotors | None


def scale_thrust(vehicle: Vehicle, factor: float) -> Vehicle:
    """Return the vehicle with stronger or weaker propellers.

    Thrust map and limit are multiplied by the factor; mass and rotor speeds stay.
    """
    rotors = vehicle.rotors
    if rotors:
        c2, c1, c0 = rotors.thrust_map
        rotors = replace(rotors, thrust_map=(c2 * factor, c1 * factor, c0 * factor))
    return replace(vehicle, thrust_max=vehicle.thrust_max * factor, rotors=rotors)


def with_thrust_to_weight(vehicle: Vehicle, ratio: float) -> Vehicle:
    """Return the vehicle with a full thrust of `ratio` times its weight, named after the ratio."""
    scaled = scale_thrust(vehicle, ratio * GRAVITY / vehicle.thrust_max)
    return replace(scaled, name=f"{vehicle.name}-twr{ratio:g}")
