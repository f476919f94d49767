"""Vehicle: the numbers of one quadrotor, read from `vehicles/*.yaml` with Flightmare's key names."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path

from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse
from quadsim.vehicle.vehicle_file import RotorsEntry, VehicleFile, faults

VEHICLES = Path(__file__).parent
Vec3 = tuple[float, float, float]
GRAVITY = 9.81  # [m/s^2]


@dataclass(frozen=True)
class Rotors:
    """Four rotors: front-right, back-left, front-left, back-right; see `spin`."""

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


def vehicle_names() -> tuple[str, ...]:
    """The vehicles that come with the project."""
    return names(VEHICLES)


def load_vehicle(name_or_path: str | Path) -> Vehicle:
    """A vehicle by name ("swift") or path ("mine.yaml"). Raises FileError."""
    path = locate(name_or_path, VEHICLES, "vehicle")
    return parse_vehicle(read_text(path), str(path))


def parse_vehicle(text: str, file: str) -> Vehicle:
    """A vehicle from its text; `file` is shown in errors and gives it its name. Raises FileError."""
    document = parse(text, file)
    entry = document.fill(VehicleFile)
    for path, problem in faults(entry, GRAVITY):
        raise document.error(path, problem)
    return Vehicle(
        name=Path(file).stem,
        source=entry.source,
        mass=entry.mass,
        inertia=entry.inertia,
        radius=entry.radius,
        rate_tau=entry.rate_tau,
        rate_max=entry.omega_max,
        thrust_max=_thrust_max(entry),
        drag=entry.drag,
        latency=entry.latency,
        rotors=_rotors(entry.rotors) if entry.rotors else None,
    )


def scale_thrust(vehicle: Vehicle, factor: float) -> Vehicle:
    """Stronger or weaker propellers: thrust map and limit times the factor, mass and rotor speeds as they were."""
    rotors = vehicle.rotors
    if rotors:
        c2, c1, c0 = rotors.thrust_map
        rotors = replace(rotors, thrust_map=(c2 * factor, c1 * factor, c0 * factor))
    return replace(vehicle, thrust_max=vehicle.thrust_max * factor, rotors=rotors)


def with_thrust_to_weight(vehicle: Vehicle, ratio: float) -> Vehicle:
    """The vehicle with full thrust of `ratio` times its weight, and a name that says so."""
    scaled = scale_thrust(vehicle, ratio * GRAVITY / vehicle.thrust_max)
    return replace(scaled, name=f"{vehicle.name}-twr{ratio:g}")


def _thrust_max(entry: VehicleFile) -> float:
    """Given, or of four rotors at full speed, 4 T(omega_max) / mass [m/s^2]."""
    if entry.rotors is None:
        return entry.thrust_max or 0.0  # never 0: faults() has seen it
    return 4 * entry.rotors.thrust(entry.rotors.motor_omega_max) / entry.mass


def _rotors(entry: RotorsEntry) -> Rotors:
    """Flightmare's turning sense: the front-right and back-left rotors turn the body to the left (+)."""
    side = (entry.arm_l or 0.0) / sqrt(2)
    x, y = entry.rotor_x or side, entry.rotor_y or side
    return Rotors(
        positions=((x, -y), (-x, y), (x, y), (-x, -y)),
        spin=(1, 1, -1, -1),
        thrust_map=entry.thrust_map,
        omega_min=entry.motor_omega_min,
        omega_max=entry.motor_omega_max,
        tau=entry.motor_tau,
        kappa=entry.kappa,
    )
