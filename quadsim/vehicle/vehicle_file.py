"""Vehicle files: their keys (Flightmare's where it has them), units, ranges, defaults; how they
become a Vehicle."""

from __future__ import annotations

from collections.abc import Iterator
from math import sqrt
from pathlib import Path
from typing import Annotated

from msgspec import Struct

from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse, unit
from quadsim.vehicle.vehicle import GRAVITY, Rotors, Vehicle

VEHICLES = Path(__file__).parent

Length = Annotated[float, unit("m", gt=0, le=2)]
Speed = Annotated[float, unit("rad/s", ge=0, le=20000)]
Lag = Annotated[float, unit("s", ge=0, le=2)]
Rate = Annotated[float, unit("rad/s", gt=0, le=100)]
Moment = Annotated[float, unit("kg m^2", gt=0, le=10)]
Drag = Annotated[float, unit("1/s", ge=0, le=20)]


class RotorsEntry(Struct, frozen=True, kw_only=True):
    arm_l: Length | None = None  # centre to rotor, rotors on the diagonals of a square
    rotor_x: Length | None = None  # or: half the distance front to rear,
    rotor_y: Length | None = None  # and half the distance left to right
    motor_omega_min: Speed
    motor_omega_max: Speed
    motor_tau: Lag
    thrust_map: Annotated[tuple[float, float, float], unit("N s^2, N s, N")]
    kappa: Annotated[float, unit("m", gt=0, le=1)]


class VehicleFile(Struct, frozen=True, kw_only=True):
    source: str = ""
    mass: Annotated[float, unit("kg", gt=0, le=100)]
    inertia: tuple[Moment, Moment, Moment]
    radius: Annotated[
        float, unit("m", gt=0, le=0.25)
    ]  # a course keeps this much free around its start
    rate_tau: tuple[Lag, Lag, Lag]
    omega_max: tuple[Rate, Rate, Rate]
    thrust_max: Annotated[float, unit("m/s^2", gt=0, le=1000)] | None = None  # without rotors
    drag: tuple[Drag, Drag, Drag] = (0.0, 0.0, 0.0)
    latency: Annotated[float, unit("s", ge=0, le=0.5)] = 0.0
    rotors: RotorsEntry | None = None


def vehicle_names() -> tuple[str, ...]:
    """The vehicles that come with the project."""
    return names(VEHICLES)


def load_vehicle(name_or_path: str | Path) -> Vehicle:
    """A vehicle by name ("swift") or path ("mine.yaml"). Raises FileError."""
    path = locate(name_or_path, VEHICLES, "vehicle")
    return parse_vehicle(read_text(path), str(path))


def parse_vehicle(text: str, file: str) -> Vehicle:
    """A vehicle from its text; `file` is shown in errors and gives it its name. Raises
    FileError."""
    document = parse(text, file)
    entry = document.fill(VehicleFile)
    for path, problem in _faults(entry):
        raise document.error(path, problem)
    rotors = _rotors(entry.rotors) if entry.rotors else None
    full = 4 * rotors.thrust(rotors.omega_max) / entry.mass if rotors else entry.thrust_max
    assert full is not None  # _faults has seen to it
    same = {
        key: getattr(entry, key)
        for key in ("source", "mass", "inertia", "radius", "rate_tau", "drag", "latency")
    }
    return Vehicle(
        Path(file).stem, rate_max=entry.omega_max, thrust_max=full, rotors=rotors, **same
    )


def _rotors(entry: RotorsEntry) -> Rotors:
    """With Flightmare's directions of rotation: front-right and back-left turn the body to the left
    (+)."""
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


def _faults(entry: VehicleFile) -> Iterator[tuple[str, str]]:
    """Everything that does not fit together, as (key, problem)."""
    if 2 * max(entry.inertia) > sum(entry.inertia):
        yield (
            "inertia",
            "expected each moment at most the sum of the other two [kg m^2], got "
            + _list(entry.inertia),
        )
    if entry.rotors is None:
        if entry.thrust_max is None:
            yield "thrust_max", "missing, expected a number [m/s^2], or rotors"
        elif entry.thrust_max <= GRAVITY:
            yield (
                "thrust_max",
                f"cannot hover: expected more than {GRAVITY} [m/s^2], got {entry.thrust_max:g}",
            )
        return
    if entry.thrust_max is not None:
        yield (
            "thrust_max",
            "not with rotors, whose thrust_map and motor_omega_max say it: remove one",
        )
    yield from _rotor_faults(entry.rotors, entry.mass * GRAVITY)


def _rotor_faults(entry: RotorsEntry, weight: float) -> Iterator[tuple[str, str]]:
    """weight: [N]."""
    rotors = _rotors(entry)
    square, oblong = entry.arm_l is not None, (entry.rotor_x is not None, entry.rotor_y is not None)
    if oblong != (not square, not square):
        yield "rotors", "expected either arm_l [m] or both rotor_x and rotor_y [m]"
    low, high, (c2, c1, _) = rotors.omega_min, rotors.omega_max, rotors.thrust_map
    if low >= high:
        yield (
            "rotors.motor_omega_max",
            f"expected more than motor_omega_min = {low:g} [rad/s], got {high:g}",
        )
    if c2 <= 0.0 or 2 * c2 * low + c1 < 0.0:
        rising = "expected thrust that rises, ever faster, with the speed"
        yield "rotors.thrust_map", f"{rising}, got {_list(rotors.thrust_map)}"
    idle, full = 4 * rotors.thrust(low), 4 * rotors.thrust(high)
    if full <= weight:
        yield (
            "rotors",
            f"cannot hover: expected more than the weight of {weight:.2f} N, got {full:.2f} N at full speed",
        )
    if idle >= weight:
        yield (
            "rotors",
            f"cannot descend: expected less than the weight of {weight:.2f} N, got {idle:.2f} N at idle",
        )


def _list(numbers: tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{n:g}" for n in numbers) + "]"
