"""What a vehicle file may say: keys (Flightmare's where it has them), units, ranges, defaults; how they fit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated

from msgspec import Struct

from quadsim.files.strict_yaml import unit

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

    def thrust(self, omega: float) -> float:
        """c2 W^2 + c1 W + c0 of one rotor [N], W in [rad/s]."""
        c2, c1, c0 = self.thrust_map
        return (c2 * omega + c1) * omega + c0


class VehicleFile(Struct, frozen=True, kw_only=True):
    source: str = ""
    mass: Annotated[float, unit("kg", gt=0, le=100)]
    inertia: tuple[Moment, Moment, Moment]
    radius: Annotated[float, unit("m", gt=0, le=0.25)]  # a course keeps this much free around its start
    rate_tau: tuple[Lag, Lag, Lag]
    omega_max: tuple[Rate, Rate, Rate]
    thrust_max: Annotated[float, unit("m/s^2", gt=0, le=1000)] | None = None  # without rotors
    drag: tuple[Drag, Drag, Drag] = (0.0, 0.0, 0.0)
    latency: Annotated[float, unit("s", ge=0, le=0.5)] = 0.0
    rotors: RotorsEntry | None = None


def faults(entry: VehicleFile, gravity: float) -> Iterator[tuple[str, str]]:
    """Everything that does not fit together, as (key, problem). gravity: [m/s^2]."""
    if 2 * max(entry.inertia) > sum(entry.inertia):
        yield "inertia", "expected each moment at most the sum of the other two [kg m^2], got " + _list(entry.inertia)
    if entry.rotors is None:
        if entry.thrust_max is None:
            yield "thrust_max", "missing, expected a number [m/s^2], or rotors"
        elif entry.thrust_max <= gravity:
            yield "thrust_max", f"cannot hover: expected more than {gravity} [m/s^2], got {entry.thrust_max:g}"
        return
    if entry.thrust_max is not None:
        yield "thrust_max", "not with rotors, whose thrust_map and motor_omega_max say it: remove one"
    yield from _rotor_faults(entry.rotors, entry.mass * gravity)


def _rotor_faults(rotors: RotorsEntry, weight: float) -> Iterator[tuple[str, str]]:
    """weight: [N]."""
    square, oblong = rotors.arm_l is not None, (rotors.rotor_x is not None, rotors.rotor_y is not None)
    if oblong != (not square, not square):
        yield "rotors", "expected either arm_l [m] or both rotor_x and rotor_y [m]"
    low, high, (c2, c1, _) = rotors.motor_omega_min, rotors.motor_omega_max, rotors.thrust_map
    if low >= high:
        yield "rotors.motor_omega_max", f"expected more than motor_omega_min = {low:g} [rad/s], got {high:g}"
    if c2 <= 0.0 or 2 * c2 * low + c1 < 0.0:
        yield (
            "rotors.thrust_map",
            f"expected thrust that rises, ever faster, with the speed, got {_list(rotors.thrust_map)}",
        )
    idle, full = 4 * rotors.thrust(low), 4 * rotors.thrust(high)
    if full <= weight:
        yield "rotors", f"cannot hover: expected more than the weight of {weight:.2f} N, got {full:.2f} N at full speed"
    if idle >= weight:
        yield "rotors", f"cannot descend: expected less than the weight of {weight:.2f} N, got {idle:.2f} N at idle"


def _list(numbers: tuple[float, ...]) -> str:
    return "[" + ", ".join(f"{n:g}" for n in numbers) + "]"
