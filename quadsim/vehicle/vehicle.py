"""Vehicle: the parameters of one quadrotor as plain values, and vehicle files.

A vehicle file has the keys of VehicleFile, with units, ranges and defaults; the names follow
Flightmare. `parse_vehicle` reads a vehicle file, and `Vehicle.to_yaml` writes one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict as dataclass_dict
from dataclasses import dataclass, replace
from math import isclose, nextafter, sqrt
from pathlib import Path
from typing import Annotated, Any, TypedDict, Unpack

from msgspec import Struct
from msgspec.structs import asdict

from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import parse, setting, unit
from quadsim.files.values import FieldProblem, SettingError
from quadsim.files.yaml_text import dump, remade, written
from quadsim.rotation import Vec3

GRAVITY = 9.81  # [m/s^2]
NO_LEAD: Vec3 = (0.0, 0.0, 0.0)
VEHICLES = Path(__file__).parent
# Keys of a vehicle file whose names differ from the attributes of Vehicle and Rotors
KEYS = {"rate_max": "omega_max"}
KEYS_OF_ROTORS = {
    "omega_min": "motor_omega_min",
    "omega_max": "motor_omega_max",
    "tau": "motor_tau",
    "response": "motor_response",
    "positions": "arm_l, or rotor_x and rotor_y",
}
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
    # a [1/s] and b [1/rad] of W' = a (c - W) + b (c^2 - W^2) while the speed W rises to its command
    # c, then a and b while it falls; None: W' = (c - W) / tau
    response: tuple[float, float, float, float] | None = None

    def lag(self, speed: float, command: float) -> float:
        """Return the time constant of the speed on its way to a command [s].

        Args:
            speed: present speed [rad/s].
            command: commanded speed [rad/s].
        """
        if self.response is None:
            return self.tau
        a_up, b_up, a_down, b_down = self.response
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


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations of a vehicle's numbers, relative to them: 0.02 is 2 %.

    Domain randomization draws from them, see quadsim.physics.domain_randomization.
    """

    mass: float
    # of the full thrust
    thrust: float
    # of the lags of the body rates
    rate_lag: float
    # of the lag of the rotors
    motor_lag: float
    drag: float


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


@dataclass(frozen=True)
class Vehicle:
    """A quadrotor as the plant flies it.

    Thrusts and drag are mass-normalised, so the vehicle `paper` needs no mass.

    Examples:
        >>> import quadsim
        >>> swift = quadsim.load_vehicle("swift")
        >>> heavy = swift.but(mass=0.9, rotors={"motor_tau": 0.05})
        >>> run = quadsim.fly("figure8", vehicle=heavy, laps=1, samples=256)
        >>> run.outcome
        'finished'
    """

    name: str
    source: str
    # [kg]
    mass: float
    # principal moments [kg m^2]
    inertia: Vec3
    # radius of the sphere that represents the vehicle in contacts [m]
    radius: float
    # lags of the first-order rate loop about x, y, z [s]
    rate_tau: Vec3
    # limits of the body-rate commands [rad/s]
    rate_max: Vec3
    # largest collective thrust, mass-normalised [m/s^2]
    thrust_max: float
    # linear drag, body frame [1/s]
    drag: Vec3
    # latency from command to actuator [s]
    latency: float
    # None: the thrust acts at once, without limits of single rotors
    rotors: Rotors | None
    # None: not known
    uncertainty: Uncertainty | None = None
    # time by which the rate loop looks ahead at the body rates, by their derivative [s]
    rate_lead: Vec3 = NO_LEAD

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
            path: file to write, after which the vehicle is named; None writes nothing.

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


class RotorsEntry(Struct, frozen=True, kw_only=True):
    """The rotors of a vehicle file."""

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


Share = Annotated[float, unit("share", ge=0, le=0.5)]


class UncertaintyEntry(Struct, frozen=True, kw_only=True):
    """How well the numbers of a vehicle are known, in a vehicle file."""

    mass: Annotated[Share, setting("standard deviation of the mass, relative")]
    thrust: Annotated[Share, setting("standard deviation of the full thrust, relative")]
    rate_lag: Annotated[Share, setting("standard deviation of the body rates' lags, relative")]
    motor_lag: Annotated[Share, setting("standard deviation of the rotors' lag, relative")]
    drag: Annotated[Share, setting("standard deviation of the drag, relative")]


class VehicleFile(Struct, frozen=True, kw_only=True):
    """The keys of a vehicle file."""

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
    rotors: RotorsEntry | None = None
    uncertainty: UncertaintyEntry | None = None


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
        file: shown in errors; gives the vehicle its name.

    Raises:
        FileError: the text is not a vehicle.
    """
    document = parse(text, file)
    entry = document.fill(VehicleFile)
    document.check(_problems(entry))
    rotors = _rotors(entry.rotors) if entry.rotors else None
    thrust_max = entry.thrust_max
    if rotors:
        thrust_max = 4 * rotors.thrust(rotors.omega_max) / entry.mass
    # `_problems` has rejected a vehicle with neither rotors nor thrust_max.
    assert thrust_max is not None
    return Vehicle(
        name=Path(file).stem,
        source=entry.source,
        mass=entry.mass,
        inertia=entry.inertia,
        radius=entry.radius,
        rate_tau=entry.rate_tau,
        rate_max=entry.omega_max,
        thrust_max=thrust_max,
        drag=entry.drag,
        latency=entry.latency,
        rotors=rotors,
        uncertainty=Uncertainty(**asdict(entry.uncertainty)) if entry.uncertainty else None,
        rate_lead=entry.rate_lead,
    )


def _changed(vehicle: Vehicle, changes: Mapping[str, Any]) -> Vehicle:
    """Return the vehicle with changed values of some keys; see Vehicle.but.

    Raises:
        SettingError: a value cannot be used.
    """
    _check_keys(changes, KEYS)
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
        given["uncertainty"] = dataclass_dict(known)
    return replace(remade({**entries, **given}, parse_vehicle, name), name=name)


def _changed_rotors(rotors: Rotors | None, changes: Any) -> Any:
    """Return the entry of the rotors with changed values of some keys."""
    if isinstance(changes, Rotors):
        return _rotors_entry(changes)
    if not isinstance(changes, Mapping):
        return changes
    _check_keys(changes, KEYS_OF_ROTORS, "rotors.")
    entry = _rotors_entry(rotors) if rotors else {}
    sides = {"rotor_x", "rotor_y"}
    if "arm_l" in changes:
        entry = {key: value for key, value in entry.items() if key not in sides}
    elif rotors and sides & changes.keys():
        entry.pop("arm_l", None)
        x, y = rotors.positions[2]
        entry = {"rotor_x": x, "rotor_y": y, **entry}
    return {**entry, **changes}


def _check_keys(changes: Mapping[str, Any], keys: Mapping[str, str], parent: str = "") -> None:
    """Raise SettingError for a name that is no key of a vehicle file."""
    for name in changes:
        if name in keys:
            raise SettingError(f"{parent}{name}", f"a vehicle file has it as {keys[name]}")


def check_vehicle(vehicle: Vehicle) -> None:
    """Check the numbers of a vehicle that comes from no file by the ranges of a vehicle file.

    Raises:
        SettingError: a number is out of range, or the numbers do not fit together.
    """
    remade(_entries(vehicle), parse_vehicle, vehicle.name)
    # The thrust of a vehicle with rotors, and the places of the rotors, are no keys of a file.
    alone = _entries(replace(vehicle, rotors=None, rate_lead=NO_LEAD))
    remade(alone, parse_vehicle, vehicle.name)
    if vehicle.rotors is None:
        return
    sides = [abs(side) for position in vehicle.rotors.positions for side in position]
    if len(sides) != 8 or not all(0.0 < side <= LARGEST_ARM for side in sides):
        wanted = f"expected 4 pairs of numbers within +-{LARGEST_ARM:g} [m], none of them 0"
        raise SettingError("rotors.positions", f"{wanted}, got {vehicle.rotors.positions}")
    if sorted(vehicle.rotors.spin) != [-1, -1, 1, 1]:
        wanted = "expected two rotors of each direction, 1 and -1"
        raise SettingError("rotors.spin", f"{wanted}, got {vehicle.rotors.spin}")


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
    if replace(again, name=vehicle.name, thrust_max=vehicle.thrust_max) != vehicle:
        wanted = "expected rotors on a rectangle, as a vehicle file has them"
        raise SettingError("rotors", f"{wanted}, got others")
    return dump(entries)


def _entries(vehicle: Vehicle) -> dict[str, Any]:
    """Return the entries of a vehicle file without the ones at their default."""
    entries: dict[str, Any] = {
        "source": vehicle.source,
        "mass": vehicle.mass,
        "inertia": vehicle.inertia,
        "radius": vehicle.radius,
        "rate_tau": vehicle.rate_tau,
        "rate_lead": vehicle.rate_lead,
        "omega_max": vehicle.rate_max,
        "thrust_max": None if vehicle.rotors else vehicle.thrust_max,
        "drag": vehicle.drag,
        "latency": vehicle.latency,
        "rotors": _rotors_entry(vehicle.rotors) if vehicle.rotors else None,
        "uncertainty": dataclass_dict(vehicle.uncertainty) if vehicle.uncertainty else None,
    }
    defaults = {"source": "", "thrust_max": None, "drag": (0.0, 0.0, 0.0), "latency": 0.0}
    defaults |= {"rotors": None, "uncertainty": None, "rate_lead": NO_LEAD}
    return {
        key: value
        for key, value in entries.items()
        if key not in defaults or value != defaults[key]
    }


def _rotors_entry(rotors: Rotors) -> dict[str, Any]:
    """Return the entry of the rotors in a vehicle file."""
    # The third rotor is at front-left.
    x, y = rotors.positions[2]
    arm = _arm(x) if x == y else None
    place = {"rotor_x": x, "rotor_y": y} if arm is None else {"arm_l": arm}
    return {
        **place,
        "motor_omega_min": rotors.omega_min,
        "motor_omega_max": rotors.omega_max,
        "motor_tau": rotors.tau,
        **({"motor_response": rotors.response} if rotors.response else {}),
        "thrust_map": rotors.thrust_map,
        "kappa": rotors.kappa,
    }


def _arm(side: float) -> float | None:
    """Return the arm_l [m] that gives rotors at exactly +-side [m], None if there is none."""
    arm = side * sqrt(2)
    near = (round(arm, 6), arm, nextafter(arm, 0.0), nextafter(arm, 1.0))
    return next((each for each in near if each / sqrt(2) == side), None)


def _rotors(entry: RotorsEntry) -> Rotors:
    """Return the rotors, with Flightmare's directions of rotation.

    The reaction torques of front-right and back-left turn the body to the left (+).
    """
    side = (entry.arm_l or 0.0) / sqrt(2)
    x = entry.rotor_x or side
    y = entry.rotor_y or side
    return Rotors(
        positions=((x, -y), (-x, y), (x, y), (-x, -y)),
        spin=(1, 1, -1, -1),
        thrust_map=entry.thrust_map,
        omega_min=entry.motor_omega_min,
        omega_max=entry.motor_omega_max,
        tau=entry.motor_tau,
        response=entry.motor_response,
        kappa=entry.kappa,
    )


def unlikely_inertia(vehicle: Vehicle) -> str:
    """Return why a vehicle's inertia is that of a larger body, "" where it is not.

    A body within a sphere of the radius has at most mass x radius^2; what counts is the radius of
    contacts, from which parts may stick out.
    """
    most = vehicle.mass * (LARGEST_GYRATION * vehicle.radius) ** 2
    if max(vehicle.inertia) <= most:
        return ""
    body = f"mass {vehicle.mass:g} kg x ({LARGEST_GYRATION:g} x radius {vehicle.radius:g} m)^2"
    return (
        f"inertia looks like that of a larger body, expected at most {most:.3g} kg m^2 "
        f"({body}), got {_list(vehicle.inertia)}"
    )


def _problems(entry: VehicleFile) -> Iterator[FieldProblem]:
    """Yield all faults of a vehicle, the most important first."""
    if 2 * max(entry.inertia) > sum(entry.inertia):
        expected = "expected each moment at most the sum of the other two [kg m^2]"
        yield FieldProblem("inertia", f"{expected}, got {_list(entry.inertia)}")
    if entry.rate_lead != NO_LEAD and not entry.rotors:
        problem = f"expected none without rotors, which lag, got {_list(entry.rate_lead)}"
        yield FieldProblem("rate_lead", problem)
    if entry.rotors:
        if entry.thrust_max is not None:
            problem = "expected none beside rotors, whose thrust_map gives it: remove one"
            yield FieldProblem("thrust_max", problem)
        yield from _rotor_problems(entry.rotors, entry.mass * GRAVITY)
    elif entry.thrust_max is None:
        yield FieldProblem("thrust_max", "missing, expected a number [m/s^2], or rotors")
    elif entry.thrust_max <= GRAVITY:
        problem = f"cannot hover: expected more than {GRAVITY} [m/s^2], got {entry.thrust_max:g}"
        yield FieldProblem("thrust_max", problem)


def _rotor_problems(entry: RotorsEntry, weight: float) -> Iterator[FieldProblem]:
    """Yield the faults of the rotors.

    Args:
        entry: entry of the file.
        weight: weight of the vehicle [N].
    """
    sides = [entry.rotor_x is not None, entry.rotor_y is not None]
    one_way = not any(sides) if entry.arm_l is not None else all(sides)
    if not one_way:
        yield FieldProblem("rotors", "expected either arm_l [m] or both rotor_x and rotor_y [m]")

    rotors = _rotors(entry)
    low = rotors.omega_min
    high = rotors.omega_max
    if low >= high:
        problem = f"expected more than motor_omega_min = {low:g} [rad/s], got {high:g}"
        yield FieldProblem("rotors.motor_omega_max", problem)
    c2, c1, _ = rotors.thrust_map
    if c2 <= 0.0 or 2 * c2 * low + c1 < 0.0:
        expected = "expected thrust that rises, ever faster, with the speed"
        yield FieldProblem("rotors.thrust_map", f"{expected}, got {_list(rotors.thrust_map)}")

    if rotors.response:
        a_up, b_up, a_down, b_down = rotors.response
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
