"""Complete a vehicle from a few known numbers by scaling the most similar shipped vehicle.

    J = J_0 (m / m_0) (l / l_0)^2          equal radii of gyration for the arm l
    c_2 = c_20 (D / D_0)^4                 equal shapes of propellers with the diameter D
    W_max = sqrt(r m g / (4 c_2))          the given ratio r of thrust to weight
    kappa = kappa_0 D / D_0

The law of the thrust coefficient c_2 agrees with the shipped vehicles: from kingfisher's 5 inch
propellers it predicts kolibri's 3 inch propellers to 12 % and the Crazyflie's 46 mm ones to 7 %.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot, log, sqrt
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from quadsim.files.strict_yaml import unit
from quadsim.files.values import SettingError, check_fields
from quadsim.files.yaml_text import with_comments, written
from quadsim.vehicle.vehicle import GRAVITY, Vehicle, load_vehicle

INCH = 0.0254  # [m]
# The vehicles that are scaled -> the diameter of their propellers [m]
PROPELLERS = {"kingfisher": 5 * INCH, "kolibri": 3 * INCH, "crazyflie": 0.046}
# Units in which a propeller's diameter is given, the longer names first -> [m]
DIAMETERS = {"inch": INCH, "in": INCH, '"': INCH, "mm": 1e-3, "cm": 1e-2, "m": 1.0}
DIGITS = 5
# Largest radius of a vehicle file [m]
LARGEST_RADIUS = 0.25

Mass = Annotated[float, unit("kg", ge=0.01, le=20)]
Ratio = Annotated[float, Meta(gt=1, le=20)]
Arm = Annotated[float, unit("m", ge=0.02, le=0.5)]
Diameter = Annotated[float, unit("m", ge=0.02, le=0.6)]


@dataclass(frozen=True, kw_only=True)
class KnownNumbers:
    """The known numbers of a vehicle; None stands for an unknown number."""

    mass: Mass  # [kg]
    thrust_to_weight: Ratio
    # from the centre to a rotor, for rotors on the diagonals of a square [m]
    arm: Arm | None = None
    # diameter of the propellers [m]
    propeller: Diameter | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_fields(self)


@dataclass(frozen=True)
class ScaledVehicle:
    """A vehicle, and the source of each of its numbers.

    Attributes:
        vehicle: the vehicle.
        sources: a mapping from keys of a vehicle file to the source of the number.
    """

    vehicle: Vehicle
    sources: Mapping[str, str]

    def to_yaml(self, path: str | Path | None = None) -> str:
        """Return the text of a vehicle file whose comments say where each number comes from.

        Args:
            path: file to write; None writes nothing.

        Raises:
            FileError: the file cannot be written.
        """
        return written(with_comments(self.vehicle.to_yaml(), self.sources), path)


def diameter(text: str) -> float:
    """Return the diameter of a propeller [m] that is written with its unit: 5in, 127mm, .127m.

    Raises:
        SettingError: the text is not a length with its unit.
    """
    given = text.strip().lower()
    for name, metres in DIAMETERS.items():
        number = given.removesuffix(name)
        if number != given:
            try:
                return float(number) * metres
            except ValueError:
                break
    wanted = "expected the diameter of a propeller with its unit, such as 5in or 127mm"
    raise SettingError("prop", f"{wanted}, got {text!r}")


def scaled_vehicle(known: KnownNumbers, name: str) -> ScaledVehicle:
    """Return the vehicle with these numbers; all others are scaled from a shipped vehicle.

    Args:
        known: known numbers of the vehicle.
        name: name of the vehicle.

    Raises:
        SettingError: no vehicle file can have these numbers.

    Examples:
        >>> from quadsim.vehicle.scaling import KnownNumbers, scaled_vehicle
        >>> scaled = scaled_vehicle(KnownNumbers(mass=0.6, thrust_to_weight=5, arm=0.11), "myquad")
        >>> round(scaled.vehicle.thrust_to_weight, 3)
        5.0
        >>> scaled.sources["drag"]
        '[1/s] as kingfisher'
    """
    base = _nearest(known)
    rotors = base.rotors
    assert rotors is not None
    base_arm = hypot(*rotors.positions[0])
    base_propeller = PROPELLERS[base.name]
    arm = known.arm or _rounded(base_arm * (known.mass / base.mass) ** (1.0 / 3.0))
    propeller = known.propeller or _rounded(base_propeller * arm / base_arm)
    inertia_scale = known.mass / base.mass * (arm / base_arm) ** 2
    thrust_scale = (propeller / base_propeller) ** 4

    side = arm / sqrt(2.0)
    radius = side + 0.5 * propeller
    if radius > LARGEST_RADIUS:
        wanted = f"expected arm / sqrt(2) + prop / 2 of at most {LARGEST_RADIUS:g} m"
        raise SettingError("arm", f"{wanted}, the largest sphere in contacts, got {radius:.3g} m")
    square = _rounded(rotors.thrust_map[0] * thrust_scale)
    full = _rounded(sqrt(known.thrust_to_weight * known.mass * GRAVITY / (4.0 * square)))
    vehicle = base.but(
        name=name,
        source=f"a few numbers of its own; the others are scaled from {base.name}",
        mass=known.mass,
        inertia=_inertia(base, inertia_scale),
        radius=_rounded(radius),
        latency=0.0,
        rotors={
            "arm_l": arm,
            "motor_omega_max": full,
            "motor_omega_min": _rounded(rotors.motor_omega_min / rotors.motor_omega_max * full),
            "thrust_map": (square, 0.0, 0.0),
            "kappa": _rounded(rotors.kappa * propeller / base_propeller),
        },
    )
    of = base.name
    arm_source = "given" if known.arm else f"{of}'s {base_arm:.4g} x (mass / {base.mass:g})^(1/3)"
    blades = "given" if known.propeller else f"{of}'s for the arm"
    disc = f"propellers of {1e3 * propeller:.4g} mm ({blades})"
    sources = {
        "mass": "[kg] given",
        "inertia": f"[kg m^2] {of}'s x mass / {base.mass:g} x (arm_l / {base_arm:.4g})^2",
        "radius": f"[m] arm_l / sqrt(2), and half of {disc}",
        "rate_tau": f"[s] as {of}",
        "omega_max": f"[rad/s] as {of}",
        "drag": f"[1/s] as {of}",
        "arm_l": f"[m] {arm_source}",
        "motor_omega_min": f"[rad/s] as {of}, the same share of full speed",
        "motor_omega_max": (
            f"[rad/s] {known.thrust_to_weight:g} times the weight, as given, by thrust_map"
        ),
        "motor_tau": f"[s] as {of}",
        "thrust_map": f"{of}'s x (prop / {1e3 * base_propeller:.4g} mm)^4, {disc}",
        "kappa": f"[m] {of}'s x prop / {1e3 * base_propeller:.4g} mm",
    }
    return ScaledVehicle(vehicle, sources)


def _nearest(known: KnownNumbers) -> Vehicle:
    """Return the shipped vehicle with the nearest arm, or the nearest mass if no arm is known."""
    vehicles = [load_vehicle(name) for name in PROPELLERS]

    def distance(vehicle: Vehicle) -> float:
        if known.arm is None or vehicle.rotors is None:
            return abs(log(known.mass / vehicle.mass))
        return abs(log(known.arm / hypot(*vehicle.rotors.positions[0])))

    return min(vehicles, key=distance)


def _inertia(base: Vehicle, scale: float) -> tuple[float, float, float]:
    """Return the scaled inertia [kg m^2] with equal moments about x and y, as on a square frame."""
    about_x, about_y, about_z = base.inertia
    across = _rounded(0.5 * (about_x + about_y) * scale)
    return across, across, _rounded(about_z * scale)


def _rounded(number: float) -> float:
    return float(f"{number:.{DIGITS}g}")
