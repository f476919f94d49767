"""Vehicle: the parameters of one quadrotor as plain values, and vehicle files.

A vehicle file has the keys of VehicleFile, with units, ranges and defaults; the names follow
Flightmare. A Vehicle has the values of such a file, and a name. `parse_vehicle` reads a vehicle
file, and `Vehicle.to_yaml` writes one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from math import isclose, sqrt
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypedDict, Unpack

from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse, setting, unit
from quadsim.files.values import FieldProblem, SettingError
from quadsim.files.yaml_text import dump, entries_of, remade, written
from quadsim.rotation import Vec3

GRAVITY = 9.81  # [m/s^2]
NO_LEAD: Vec3 = (0.0, 0.0, 0.0)
VEHICLES = Path(__file__).parent
# Name of a vehicle with a changed thrust-to-weight ratio
SCALED = re.compile(r"(?P<name>[^/.]+)-twr(?P<ratio>\d+(\.\d+)?)")
LARGEST_RATIO = 20.0
# Tolerance for rounding between thrust_max and the thrust of the rotors
ROUNDING = 1e-9

LARGEST_ARM = 2.0  # of a rotor, along x or y [m]
# A larger radius of gyration than this many radii is probably a mistake of units.
LARGEST_GYRATION = 2.0

Length = Annotated[float, unit("m", gt=0, le=LARGEST_ARM)]
Speed = Annotated[float, unit("rad/s", ge=0, le=20000)]
Lag = Annotated[float, unit("s", ge=0, le=2)]
Rate = Annotated[float, unit("rad/s", gt=0, le=100)]
# A rate that is 0 for both would never let the speed change: `_rotor_problems` checks their sum.
Response = Annotated[float, unit("1/s, 1/rad", ge=0, le=1e4)]
Moment = Annotated[float, unit("kg m^2", gt=0, le=10)]
Drag = Annotated[float, unit("1/s", ge=0, le=20)]


@dataclass(frozen=True, kw_only=True)
class Rotors:
    """Four rotors: front-right, back-left, front-left, back-right.

    Examples:
        >>> import quadsim
        >>> rotors = quadsim.load_vehicle("swift").rotors
        >>> speed = rotors.speed(2.0)  # of a rotor that gives 2 N [rad/s]
        >>> round(rotors.thrust(speed), 6)
        2.0
    """

    arm_l: Annotated[
        Length | None, setting("centre to rotor, for rotors on the diagonals of a square [m]")
    ] = None
    rotor_x: Annotated[Length | None, setting("half the distance front to rear [m]")] = None
    rotor_y: Annotated[Length | None, setting("half the distance left to right [m]")] = None
    motor_omega_min: Annotated[Speed, setting("speed at idle [rad/s]")]
    motor_omega_max: Annotated[Speed, setting("full speed [rad/s]")]
    motor_tau: Annotated[Lag, setting("lag of the speed [s]")]
    motor_response: Annotated[
        tuple[Response, Response, Response, Response] | None,
        setting(
            "a, b of the speed's W' = a (c - W) + b (c^2 - W^2) to a command c, rising and falling,"
            " in place of the lag, which stays that of the planner's model",
            unit="1/s, 1/rad, 1/s, 1/rad",
        ),
    ] = None
    thrust_map: Annotated[
        tuple[float, float, float],
        setting("c2, c1, c0 of the thrust c2 W^2 + c1 W + c0", unit="N s^2, N s, N"),
    ]
    kappa: Annotated[float, setting("reaction torque per thrust [m]", unit="m", gt=0, le=1)]

    # Signs of the reaction torques about body z, Flightmare's: the torques of front-right and
    # back-left turn the body to the left  (4,)
    spin: ClassVar[tuple[int, ...]] = (1, 1, -1, -1)

    @cached_property
    def positions(self) -> tuple[tuple[float, float], ...]:
        """The positions of the rotors, x and y in the body frame [m].  (4, 2)"""
        side = (self.arm_l or 0.0) / sqrt(2)
        x = self.rotor_x or side
        y = self.rotor_y or side
        return (x, -y), (-x, y), (x, y), (-x, -y)

    def lag(self, speed: float, command: float) -> float:
        """Return the time constant with which the speed approaches a command [s].

        Args:
            speed: present speed [rad/s].
            command: commanded speed [rad/s].
        """
        if self.motor_response is None:
            return self.motor_tau
        a_up, b_up, a_down, b_down = self.motor_response
        a, b = (a_up, b_up) if command > speed else (a_down, b_down)
        # a (c - W) + b (c^2 - W^2) = (a + b (c + W)) (c - W)
        return 1.0 / (a + b * (command + speed))

    def thrust(self, speed: float) -> float:
        """Return c2 W^2 + c1 W + c0, the thrust of one rotor [N] at the speed W [rad/s]."""
        c2, c1, c0 = self.thrust_map
        return (c2 * speed + c1) * speed + c0

    def speed(self, thrust: float) -> float:
        """Return the speed [rad/s] at which one rotor gives a thrust [N].

        The speed lies on the rising branch of the thrust map.
        """
        c2, c1, c0 = self.thrust_map
        return (sqrt(c1 * c1 + 4.0 * c2 * (thrust - c0)) - c1) / (2.0 * c2)


Share = Annotated[float, unit("share", ge=0, le=0.5)]


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """Relative standard deviations of a vehicle's numbers: 0.02 is 2 %.

    Domain randomization draws from them, see quadsim.physics.domain_randomization.
    """

    mass: Annotated[Share, setting("standard deviation of the mass, relative")]
    thrust: Annotated[Share, setting("standard deviation of the full thrust, relative")]
    rate_lag: Annotated[Share, setting("standard deviation of the body rates' lags, relative")]
    motor_lag: Annotated[Share, setting("standard deviation of the rotors' lag, relative")]
    drag: Annotated[Share, setting("standard deviation of the drag, relative")]


@dataclass(frozen=True, kw_only=True)
class VehicleFile:
    """The keys of a vehicle file.

    Thrusts and drag are mass-normalised, so the vehicle `paper` needs no mass.
    """

    source: Annotated[str, setting("origin of the numbers")] = ""
    mass: Annotated[float, setting("mass [kg]", unit="kg", gt=0, le=100)]
    inertia: Annotated[
        tuple[Moment, Moment, Moment], setting("principal moments about x, y, z [kg m^2]")
    ]
    # A course keeps a sphere of the largest radius free around its start.
    radius: Annotated[
        float, setting("radius of the sphere in contacts [m]", unit="m", gt=0, le=0.25)
    ]
    rate_tau: Annotated[tuple[Lag, Lag, Lag], setting("lags of the body rates about x, y, z [s]")]
    rate_lead: Annotated[
        tuple[Lag, Lag, Lag],
        setting(
            "time by which the rate loop looks ahead at the body rates about x, y, z: the ratio of"
            " its derivative to its proportional gain [s]"
        ),
    ] = NO_LEAD
    omega_max: Annotated[
        tuple[Rate, Rate, Rate], setting("limits of the body-rate commands about x, y, z [rad/s]")
    ]
    thrust_max: (
        Annotated[
            float,
            setting(
                "largest mass-normalised thrust of a vehicle without rotors [m/s^2]",
                unit="m/s^2",
                gt=0,
                le=1000,
            ),
        ]
        | None
    ) = None
    drag: Annotated[
        tuple[Drag, Drag, Drag], setting("linear drag along the body's x, y, z [1/s]")
    ] = (0.0, 0.0, 0.0)
    latency: Annotated[
        float, setting("time from command to actuator [s]", unit="s", ge=0, le=0.5)
    ] = 0.0
    # None: the thrust acts at once, without limits of single rotors
    rotors: Rotors | None = None
    # None: not known
    uncertainty: Uncertainty | None = None


class RotorChanges(TypedDict, total=False):
    """Keys of the rotors in a vehicle file."""

    arm_l: float
    rotor_x: float
    rotor_y: float
    motor_omega_min: float
    motor_omega_max: float
    motor_tau: float
    motor_response: Sequence[float] | None
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
    rate_lead: Sequence[float]
    omega_max: Sequence[float]
    thrust_max: float
    drag: Sequence[float]
    latency: float
    rotors: RotorChanges | Rotors | None
    uncertainty: Mapping[str, float] | Uncertainty | None


@dataclass(frozen=True, kw_only=True)
class Vehicle(VehicleFile):
    """A quadrotor: the values of its vehicle file, and its name.

    Examples:
        >>> import quadsim
        >>> swift = quadsim.load_vehicle("swift")
        >>> heavy = swift.but(mass=0.9, rotors={"motor_tau": 0.05})
        >>> run = quadsim.fly("figure8", vehicle=heavy, laps=1, samples=256)
        >>> run.outcome
        'finished'
    """

    name: str
    # largest collective thrust, mass-normalised, which a file has only without rotors [m/s^2]
    thrust_max: float = field()

    def __repr__(self) -> str:
        """Return one short line; `to_yaml` has all numbers."""
        ratio = f"thrust-to-weight {self.thrust_to_weight:.2f}"
        return f"<Vehicle {self.name}: {self.mass:g} kg, {ratio}>"

    @property
    def thrust_to_weight(self) -> float:
        """The ratio of the full thrust to the weight."""
        return self.thrust_max / GRAVITY

    def but(self, **changes: Unpack[VehicleChanges]) -> Vehicle:
        """Return a copy with some numbers changed, checked as in a vehicle file.

        Rotors keep their thrust in newtons: a heavier vehicle has a lower thrust_max and a lower
        thrust-to-weight ratio. Without rotors, thrust_max is mass-normalised and stays.

        Args:
            changes: keys of a vehicle file, see docs/vehicles.md, and `name`. `rotors` takes the
                keys that change, Rotors, or None, which removes them and keeps the full thrust.

        Raises:
            SettingError: a number cannot be used (a ValueError).

        Examples:
            >>> import quadsim
            >>> swift = quadsim.load_vehicle("swift")
            >>> round(swift.thrust_to_weight, 2), round(swift.but(mass=1.0).thrust_to_weight, 2)
            (4.1, 3.57)
        """

        return _changed(self, changes)

    def to_yaml(self, path: str | Path | None = None) -> str:
        """Return the text of a vehicle file that `load_vehicle` reads to an equal vehicle.

        Args:
            path: file to write, whose name becomes the vehicle's; None writes nothing.

        Raises:
            SettingError: a vehicle file cannot represent this vehicle, e.g. if rotors and mass do
                not give its thrust_max (a ValueError).
            FileError: the file cannot be written.

        Examples:
            >>> import quadsim
            >>> swift = quadsim.load_vehicle("swift")
            >>> text = swift.but(latency=0.02).to_yaml("late.yaml")
            >>> quadsim.load_vehicle("late.yaml").latency
            0.02
        """

        return written(_as_yaml(self), path)


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
    """Return the vehicle with a full thrust of `ratio` times its weight, named by the ratio."""
    scaled = scale_thrust(vehicle, ratio * GRAVITY / vehicle.thrust_max)
    return replace(scaled, name=f"{vehicle.name}-twr{ratio:g}")


def vehicle_names() -> tuple[str, ...]:
    """Return the names of the vehicles that come with the project."""
    return names(VEHICLES)


def load_vehicle(name_or_path: str | Path) -> Vehicle:
    """Return a vehicle by name ("swift") or path ("mine.yaml").

    "swift-twr6" is "swift" with a thrust-to-weight ratio of 6, see `with_thrust_to_weight`.

    Raises:
        FileError: there is no such vehicle, or the file is not a vehicle.

    Examples:
        >>> import quadsim
        >>> vehicle = quadsim.load_vehicle("swift")
        >>> vehicle.mass, vehicle.thrust_max
        (0.87, 40.2...)
    """
    scaled = SCALED.fullmatch(str(name_or_path))
    if scaled and 1.0 < float(scaled["ratio"]) <= LARGEST_RATIO:
        return with_thrust_to_weight(load_vehicle(scaled["name"]), float(scaled["ratio"]))
    path = locate(name_or_path, VEHICLES, "vehicle")
    return parse_vehicle(read_text(path), str(path))


def parse_vehicle(text: str, file: str) -> Vehicle:
    """Return the vehicle of a YAML text.

    Args:
        text: the YAML.
        file: name of the file, for errors and for the vehicle.

    Raises:
        FileError: the text is not a vehicle.
    """
    document = parse(text, file)
    numbers = document.fill(VehicleFile)
    document.check(_problems(numbers))
    rotors = numbers.rotors
    thrust_max = numbers.thrust_max
    if rotors:
        thrust_max = 4 * rotors.thrust(rotors.motor_omega_max) / numbers.mass
    # `_problems` has rejected a vehicle with neither rotors nor thrust_max.
    assert thrust_max is not None
    return Vehicle(**vars(numbers) | {"name": Path(file).stem, "thrust_max": thrust_max})


def _changed(vehicle: Vehicle, changes: Mapping[str, Any]) -> Vehicle:
    """Return the vehicle with changed values of some keys; see Vehicle.but.

    Raises:
        SettingError: a value cannot be used.
    """
    given = dict(changes)
    name = str(given.pop("name", vehicle.name))
    entries = _entries(vehicle)
    if "rotors" in given:
        rotors = given.pop("rotors")
        # The full thrust comes from the new rotors, or from the removed ones
        entries.pop("rotors" if rotors is None else "thrust_max", None)
        if rotors is None:
            entries["thrust_max"] = vehicle.thrust_max
        else:
            entries["rotors"] = _changed_rotors(vehicle.rotors, rotors)
    if isinstance(known := given.get("uncertainty"), Uncertainty):
        given["uncertainty"] = asdict(known)
    return replace(remade({**entries, **given}, parse_vehicle, name), name=name)


def _changed_rotors(rotors: Rotors | None, changes: Any) -> Any:
    """Return the entry of the rotors with changed values of some keys."""
    if isinstance(changes, Rotors):
        return entries_of(changes)
    if not isinstance(changes, Mapping):
        return changes
    entry = entries_of(rotors) if rotors else {}
    sides = {"rotor_x", "rotor_y"}
    if "arm_l" in changes:
        entry = {key: value for key, value in entry.items() if key not in sides}
    elif rotors and sides & changes.keys():
        entry.pop("arm_l", None)
        x, y = rotors.positions[2]
        entry |= {"rotor_x": x, "rotor_y": y}
    return {**entry, **changes}


def check_vehicle(vehicle: Vehicle) -> None:
    """Check a vehicle that was not read from a file by the ranges of a vehicle file.

    Raises:
        SettingError: a number is out of range, or the numbers do not fit together.
    """
    remade(_entries(vehicle), parse_vehicle, vehicle.name)
    # The thrust of a vehicle with rotors is no key of a file.
    alone = _entries(replace(vehicle, rotors=None, rate_lead=NO_LEAD))
    remade(alone, parse_vehicle, vehicle.name)


def _as_yaml(vehicle: Vehicle) -> str:
    """Return the vehicle as a vehicle file; see Vehicle.to_yaml.

    Raises:
        SettingError: a vehicle file cannot represent this vehicle.
    """
    entries = _entries(vehicle)
    again = remade(entries, parse_vehicle, vehicle.name)
    if not isclose(again.thrust_max, vehicle.thrust_max, rel_tol=ROUNDING):
        wanted = f"expected {again.thrust_max:g} [m/s^2], as rotors and mass give it"
        advice = "change numbers with Vehicle.but"
        raise SettingError("thrust_max", f"{wanted}, got {vehicle.thrust_max:g}: {advice}")
    return dump(entries)


def _entries(vehicle: Vehicle) -> dict[str, Any]:
    """Return the entries of a vehicle file, without values that equal their default."""
    entries = entries_of(vehicle, VehicleFile)
    if vehicle.rotors:
        del entries["thrust_max"]
    return entries


def unlikely_inertia(vehicle: Vehicle) -> str:
    """Return why a vehicle's inertia is too large for its size, "" if it is not.

    A body within a sphere has at most the inertia mass x radius^2. The vehicle's radius is that of
    contacts, and parts may stick out of this sphere, so a margin is left.
    """
    most = vehicle.mass * (LARGEST_GYRATION * vehicle.radius) ** 2
    if max(vehicle.inertia) <= most:
        return ""
    body = f"mass {vehicle.mass:g} kg x ({LARGEST_GYRATION:g} x radius {vehicle.radius:g} m)^2"
    return (
        f"inertia looks like that of a larger body, expected at most {most:.3g} kg m^2 "
        f"({body}), got {_list(vehicle.inertia)}"
    )


def _problems(vehicle: VehicleFile) -> Iterator[FieldProblem]:
    """Yield all faults of a vehicle, the most important first."""
    if 2 * max(vehicle.inertia) > sum(vehicle.inertia):
        expected = "expected each moment at most the sum of the other two [kg m^2]"
        yield FieldProblem("inertia", f"{expected}, got {_list(vehicle.inertia)}")
    if vehicle.rate_lead != NO_LEAD and not vehicle.rotors:
        problem = f"expected none without rotors, which lag, got {_list(vehicle.rate_lead)}"
        yield FieldProblem("rate_lead", problem)
    if vehicle.rotors:
        if vehicle.thrust_max is not None:
            problem = "expected none beside rotors, whose thrust_map gives it: remove one"
            yield FieldProblem("thrust_max", problem)
        yield from _rotor_problems(vehicle.rotors, vehicle.mass * GRAVITY)
    elif vehicle.thrust_max is None:
        yield FieldProblem("thrust_max", "missing, expected a number [m/s^2], or rotors")
    elif vehicle.thrust_max <= GRAVITY:
        problem = f"cannot hover: expected more than {GRAVITY} [m/s^2], got {vehicle.thrust_max:g}"
        yield FieldProblem("thrust_max", problem)


def _rotor_problems(rotors: Rotors, weight: float) -> Iterator[FieldProblem]:
    """Yield the faults of the rotors.

    Args:
        rotors: the rotors.
        weight: weight of the vehicle [N].
    """
    sides = [rotors.rotor_x is not None, rotors.rotor_y is not None]
    one_way = not any(sides) if rotors.arm_l is not None else all(sides)
    if not one_way:
        yield FieldProblem("rotors", "expected either arm_l [m] or both rotor_x and rotor_y [m]")

    low = rotors.motor_omega_min
    high = rotors.motor_omega_max
    if low >= high:
        problem = f"expected more than motor_omega_min = {low:g} [rad/s], got {high:g}"
        yield FieldProblem("rotors.motor_omega_max", problem)
    c2, c1, _ = rotors.thrust_map
    if c2 <= 0.0 or 2 * c2 * low + c1 < 0.0:
        expected = "expected thrust that rises, ever faster, with the speed"
        yield FieldProblem("rotors.thrust_map", f"{expected}, got {_list(rotors.thrust_map)}")

    if rotors.motor_response:
        a_up, b_up, a_down, b_down = rotors.motor_response
        if not (a_up + b_up * low > 0.0 and a_down + b_down * low > 0.0):
            problem = "expected a speed that follows its command, got rates of 0"
            yield FieldProblem("rotors.motor_response", problem)

    idle = 4 * rotors.thrust(low)
    full = 4 * rotors.thrust(high)
    if full <= weight:
        expected = f"expected more than the weight of {weight:.2f} N"
        yield FieldProblem("rotors", f"cannot hover: {expected}, got {full:.2f} N at full speed")
    if idle >= weight:
        expected = f"expected less than the weight of {weight:.2f} N"
        yield FieldProblem("rotors", f"cannot descend: {expected}, got {idle:.2f} N at idle")


def _list(numbers: tuple[float, ...]) -> str:
    """Return numbers as YAML writes a list."""
    return "[" + ", ".join(f"{n:g}" for n in numbers) + "]"
