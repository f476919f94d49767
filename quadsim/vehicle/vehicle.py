"""Vehicle: the numbers of one quadrotor as plain values.

They are read from YAML by quadsim.vehicle.vehicle_file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path
from typing import TypedDict, Unpack

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


class RotorChanges(TypedDict, total=False):
    """Keys of the rotors in a vehicle file."""

    arm_l: float
    rotor_x: float
    rotor_y: float
    motor_omega_min: float
    motor_omega_max: float
    motor_tau: float
    thrust_map: Sequence[float]
    kappa: float


class VehicleChanges(TypedDict, total=False):
    """The keys of a vehicle file, and the vehicle's name."""

    name: str
    source: str
    mass: float
    inertia: Sequence[float]
    radius: float
    rate_tau: Sequence[float]
    omega_max: Sequence[float]
    thrust_max: float
    drag: Sequence[float]
    latency: float
    rotors: RotorChanges | Rotors | None


@dataclass(frozen=True)
class Vehicle:
    """A quadrotor as the plant flies it.

    Thrusts and drag are mass-normalised, so that the vehicle `paper` needs no mass of its own.

    Examples:
        >>> import quadsim
        >>> swift = quadsim.load_vehicle("swift")
        >>> heavy = swift.but(mass=0.9, rotors={"motor_tau": 0.05})
        >>> run = quadsim.fly("figure8", vehicle=heavy, laps=1, samples=512)
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

    def __repr__(self) -> str:
        """Return one short line; `to_yaml` has all numbers."""
        ratio = f"thrust-to-weight {self.thrust_to_weight:.2f}"
        return f"<Vehicle {self.name}: {self.mass:g} kg, {ratio}>"

    @property
    def thrust_to_weight(self) -> float:
        """The full thrust by the weight."""
        return self.thrust_max / GRAVITY

    def but(self, **changes: Unpack[VehicleChanges]) -> Vehicle:
        """Return the vehicle with some numbers changed, checked as those of a vehicle file are.

        Rotors keep their thrust in newtons: a heavier vehicle has a lower thrust_max and a lower
        thrust-to-weight ratio. Without rotors, thrust_max is mass-normalised and stays.

        Args:
            changes: keys of a vehicle file, see docs/vehicles.md, and `name`. `rotors` takes the
                keys that change, Rotors, or None, which takes them away and keeps the full thrust.

        Raises:
            SettingError: a number cannot be used (a ValueError).

        Examples:
            >>> import quadsim
            >>> swift = quadsim.load_vehicle("swift")
            >>> round(swift.thrust_to_weight, 2), round(swift.but(mass=1.0).thrust_to_weight, 2)
            (4.1, 3.57)
        """
        from quadsim.vehicle.vehicle_file import changed  # here: it imports this module

        return changed(self, changes)

    def to_yaml(self, path: str | Path | None = None) -> str:
        """Return the vehicle as a vehicle file, which `load_vehicle` reads to an equal vehicle.

        Args:
            path: a file to write; its name becomes the vehicle's. None writes nothing.

        Raises:
            SettingError: a vehicle file cannot hold this vehicle, such as one whose thrust_max is
                not what rotors and mass give (a ValueError).
            FileError: the file cannot be written.

        Examples:
            >>> import quadsim
            >>> swift = quadsim.load_vehicle("swift")
            >>> text = swift.but(latency=0.02).to_yaml("late.yaml")
            >>> quadsim.load_vehicle("late.yaml").latency
            0.02
        """
        from quadsim.files.yaml_text import written
        from quadsim.vehicle.vehicle_file import as_yaml

        return written(as_yaml(self), path)


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
