"""Faults: parts of a vehicle that fail in flight.

    rotor2=.5@3.2        rotor 2 gives half of its nominal thrust, from 3.2 s on
    rotor2=0@3.2-4       rotor 2 gives no thrust from 3.2 to 4 s
    motor2=2             the lag of motor 2 is doubled
    mass=1.1@2           a payload of a tenth of the mass is picked up at 2 s
    centre=.005          the centre of mass is 5 mm off the middle
    camera=lost@2~1      no measurement arrives for 1 s from 2 s on
    gyro=frozen@2-2.5    the last measurement's values are repeated
    gyro=.1:0:0@3        a bias of .1 rad/s about x is added from 3 s on
    commands=lost@2~.1   the last command that arrived stays in force
    commands=.04@2       commands arrive 40 ms late from 2 s on

Omitted parts of a text are drawn from the seed: the rotor in `rotor=.5@3`, the direction in
`gyro=.1@3`, and the time in `rotor2=.5` and in `gyro=frozen~.1`.

Neither the planner nor the estimator has information about a fault. Parts of the vehicle fail in
the actuators, sensors when they sample, and commands on their way to the plant.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import dist, inf, sqrt
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from quadsim.course import Course
from quadsim.files.scalars import decimal_number
from quadsim.files.yaml_errors import did_you_mean
from quadsim.streams import fault_stream
from quadsim.vehicle import GRAVITY, Vehicle

ROTORS = 4
# [s] Instants that differ by less count as equal.
SAME = 1e-9
# decimals of a time in a text [s], and of a time and of a bias that the seed draws
NANOSECONDS = 9
DRAWN_DIGITS = 4
# decimals of a torque [N m] and of a centre of mass [m] that the seed draws
VECTOR_DIGITS = 6
# latest time, as in the setting `timeout` [s]
LATEST = 1e5


class Factors(NamedTuple):
    """The meaning of a factor, and its range."""

    meaning: str
    low: float
    high: float


class Vectors(NamedTuple):
    """The meaning of a vector, its axes, its unit, and its largest component."""

    meaning: str
    axes: str
    unit: str
    largest: float

    @property
    def size(self) -> int:
        """The number of components."""
        return len(self.axes.split(":"))


Effect = Literal["frozen", "lost"]
# sensors that can fail as a whole, by their keys in a sensing file
WholeSensor = Literal["imu", "rotors", "pose", "camera", "pixels"]
WHOLE_SENSORS: tuple[WholeSensor, ...] = get_args(WholeSensor)
# parts of an imu
ImuPart = Literal["gyro", "accelerometer"]
IMU_PARTS: tuple[ImuPart, ...] = get_args(ImuPart)
# part of an imu -> its bias
BIASES: dict[ImuPart, Vectors] = {
    "gyro": Vectors("a bias", "x:y:z", "rad/s", 100.0),
    "accelerometer": Vectors("a bias", "x:y:z", "m/s^2", 1000.0),
}
# parts of which the vehicle has four, and the allowed factors on thrust or lag
RotorPart = Literal["rotor", "motor"]
ROTOR_FACTORS: dict[RotorPart, Factors] = {
    "rotor": Factors("the share of thrust that is left", 0.0, 1.0),
    "motor": Factors("a factor on the motor's lag", 0.1, 10.0),
}
# numbers of the whole vehicle, and the allowed factors on them
FactorPart = Literal["thrust", "battery", "mass", "rate_gain"]
FACTORS: dict[FactorPart, Factors] = {
    "thrust": Factors("the share of all rotors' thrust that is left", 0.0, 1.0),
    "battery": Factors("the share of the highest rotor speed that is left", 0.5, 1.0),
    "mass": Factors("a factor on the mass", 0.5, 2.0),
    "rate_gain": Factors("a factor on the gains of the rate loop", 0.1, 3.0),
}
# vectors that are added, in the body frame
VectorPart = Literal["torque", "centre"]
VECTORS: dict[VectorPart, Vectors] = {
    "torque": Vectors("a torque", "x:y:z", "N m", 10.0),
    "centre": Vectors("a centre of mass", "x:y", "m", 0.1),
}
# largest delay of commands [s]
LONGEST_DELAY = 1.0
EXAMPLES = "rotor2=.5@3.2, camera=lost@2-4, gyro=.1:0:0@3 or commands=lost~.1"


class Window(NamedTuple):
    """The time of a fault."""

    # [s]; None: drawn from the seed
    start: float | None = None
    # [s]; inf: until the end of the flight
    duration: float = inf

    def active(self, t: float) -> bool:
        """Return whether the fault is active at t [s]: start <= t < end."""
        assert self.start is not None, "the time of this fault is not drawn yet"
        return -SAME <= t - self.start < self.duration - SAME

    @property
    def end(self) -> float:
        """The time at which the fault ends [s]; inf: it lasts until the end of the flight."""
        assert self.start is not None, "the time of this fault is not drawn yet"
        return round(self.start + self.duration, NANOSECONDS)

    def __str__(self) -> str:
        """Return the time in the format of a fault's text."""
        if self.start is None:
            return "" if self.duration == inf else f"~{_short(self.duration)}"
        if self.duration == inf:
            return f"@{_short(self.start)}"
        return f"@{_short(self.start)}-{_short(self.end)}"


@dataclass(frozen=True)
class RotorFault:
    """A rotor gives less than its nominal thrust, or its motor has another lag."""

    # number from 1, in the order of quadsim.vehicle.Rotors; None: drawn from the seed
    rotor: int | None
    # on the nominal thrust or lag
    factor: float
    window: Window
    part: RotorPart = "rotor"

    def __str__(self) -> str:
        """Return the fault's text."""
        number = "" if self.rotor is None else self.rotor
        return f"{self.part}{number}={_short(self.factor)}{self.window}"


@dataclass(frozen=True)
class FactorFault:
    """A number of the vehicle is multiplied by a factor."""

    part: FactorPart
    factor: float
    window: Window

    def __str__(self) -> str:
        """Return the fault's text."""
        return f"{self.part}={_short(self.factor)}{self.window}"


@dataclass(frozen=True)
class VectorFault:
    """A torque acts on the vehicle, or its centre of mass is off the middle."""

    part: VectorPart
    # in the body frame, or its norm, with a direction from the seed [N m or m]
    vector: tuple[float, ...]
    window: Window

    def __str__(self) -> str:
        """Return the fault's text."""
        return f"{self.part}={_vector_text(self.vector)}{self.window}"


@dataclass(frozen=True)
class SensorFault:
    """A sensor, or a part of the imu, repeats its last values or measures nothing."""

    sensor: WholeSensor | ImuPart
    effect: Effect
    window: Window

    def __str__(self) -> str:
        """Return the fault's text."""
        return f"{self.sensor}={self.effect}{self.window}"


@dataclass(frozen=True)
class BiasJump:
    """A bias is added to the measurements of a part of the imu."""

    sensor: ImuPart
    # bias along x, y, z of the body, or its norm, with a direction from the seed [rad/s or m/s^2]
    jump: tuple[float, ...]
    window: Window

    def __str__(self) -> str:
        """Return the fault's text."""
        return f"{self.sensor}={_vector_text(self.jump)}{self.window}"


@dataclass(frozen=True)
class CommandFault:
    """Commands arrive late at the vehicle, or not at all."""

    # beside all other delays [s]; inf: the commands are lost
    delay: float
    window: Window

    def __str__(self) -> str:
        """Return the fault's text."""
        effect = "lost" if self.delay == inf else _short(self.delay)
        return f"commands={effect}{self.window}"


FaultOfVehicle = RotorFault | FactorFault | VectorFault
FaultOfSensor = SensorFault | BiasJump
Fault = FaultOfVehicle | FaultOfSensor | CommandFault


def sensor_key(fault: FaultOfSensor) -> str:
    """Return the sensing file's key of the faulty sensor."""
    return "imu" if fault.sensor in IMU_PARTS else fault.sensor


def _short(number: float) -> str:
    """Return the shortest text for exactly this number."""
    return repr(float(number)).removesuffix(".0")


def _vector_text(vector: tuple[float, ...]) -> str:
    """Return the text of a vector, or of its norm."""
    return ":".join(map(_short, vector))


# ---- from texts ---------------------------------------------------------------------------------


def parse_fault(text: str) -> Fault:
    """Return the fault of a text; `str` of a fault returns a text of it.

    Raises:
        ValueError: the text is no fault; the message is one line.
    """
    target, is_fault, rest = text.strip().partition("=")
    if not is_fault:
        raise ValueError(f"expected PART=WHAT@TIME, such as {EXAMPLES}, got {text!r}")
    what, window = _split_time(rest, text)
    if target in IMU_PARTS:
        return _imu_part_fault(target, what, window, text)
    if target in WHOLE_SENSORS:
        return SensorFault(target, _effect(what, get_args(Effect), text), window)
    if target == "commands":
        return CommandFault(_delay(what, text), window)
    if target in FACTORS:
        return FactorFault(target, _factor(what, FACTORS[target], text), window)
    if target in VECTORS:
        return VectorFault(target, _vector(what, VECTORS[target], text), window)
    for part, factors in ROTOR_FACTORS.items():
        if target.startswith(part):
            rotor = _rotor(target, part, text)
            return RotorFault(rotor, _factor(what, factors, text), window, part)
    numbered = [part + number for part in ROTOR_FACTORS for number in ("1", "")]
    known = [*numbered, *FACTORS, *VECTORS, *WHOLE_SENSORS, *IMU_PARTS, "commands"]
    raise ValueError(f"no part {target!r} in {text!r}: {did_you_mean(target, known)}")


# the effect, then @start, @start-end or @start~duration, or ~duration alone
TIME = re.compile(
    r"(?P<what>[^@~]*)"
    r"(?:@(?P<start>[^@~-]*)(?:-(?P<end>[^@~]*))?)?"
    r"(?:~(?P<lasts>.*))?"
)


def _split_time(rest: str, text: str) -> tuple[str, Window]:
    """Split the text after the equals sign into effect and time. Raises ValueError."""
    wanted = "expected a time [s] as in @2, @2-2.5 (from, until) or ~.5 (for .5 s)"
    found = TIME.fullmatch(rest)
    if found is None or (found["end"] is not None and found["lasts"] is not None):
        raise ValueError(f"{wanted}, got {text!r}")
    start = _seconds(found["start"], wanted, text)
    end = _seconds(found["end"], wanted, text)
    duration = _seconds(found["lasts"], wanted, text)
    if end is not None and start is not None:
        duration = round(end - start, NANOSECONDS)
    if duration is not None and duration <= 0.0:
        raise ValueError(f"expected a fault that ends after it begins [s], got {text!r}")
    return found["what"], Window(start, inf if duration is None else duration)


def _seconds(text: str | None, wanted: str, fault: str) -> float | None:
    """Return a time [s], None if none is given. Raises ValueError."""
    if text is None:
        return None
    seconds = decimal_number(text)
    if seconds is None or not 0.0 <= seconds <= LATEST:
        raise ValueError(f"{wanted}, from 0 to {LATEST:g}, got {fault!r}")
    return round(seconds, NANOSECONDS)


def _rotor(target: str, part: RotorPart, text: str) -> int | None:
    """Return the number of the rotor, None if the text has none. Raises ValueError."""
    number = target.removeprefix(part)
    if not number:
        return None
    if number not in map(str, range(1, ROTORS + 1)):
        wanted = f"expected {part}1 to {part}{ROTORS}, or {part} for a drawn one"
        raise ValueError(f"{wanted}, got {text!r}")
    return int(number)


def _factor(what: str, factors: Factors, text: str) -> float:
    """Return a factor within its range. Raises ValueError."""
    can_be_lost = factors.low == 0.0
    if what == "lost" and can_be_lost:
        return 0.0
    factor = decimal_number(what)
    if factor is None or not factors.low <= factor <= factors.high:
        low = f"{factors.low:g} (lost)" if can_be_lost else f"{factors.low:g}"
        wanted = f"expected {factors.meaning}, from {low} to {factors.high:g}"
        raise ValueError(f"{wanted}, got {what!r} in {text!r}")
    return factor


def _delay(what: str, text: str) -> float:
    """Return the delay of commands [s], inf if they are lost. Raises ValueError."""
    if what == "lost":
        return inf
    delay = decimal_number(what)
    if delay is None or not 0.0 < delay <= LONGEST_DELAY:
        wanted = f"expected lost or a delay [s] up to {LONGEST_DELAY:g}"
        raise ValueError(f"{wanted}, got {what!r} in {text!r}")
    return delay


def _vector(what: str, vectors: Vectors, text: str, others: str = "") -> tuple[float, ...]:
    """Return a vector, or its norm. Raises ValueError.

    Args:
        what: text of the vector.
        vectors: what is allowed.
        text: text of the fault.
        others: what else is allowed in its place, for the error.
    """
    parts = what.split(":")
    numbers = [number for part in parts if (number := decimal_number(part)) is not None]
    fits = len(numbers) == len(parts) and len(parts) in (1, vectors.size)
    if not fits or not all(abs(number) <= vectors.largest for number in numbers):
        form = f"{vectors.meaning} as one number or {vectors.axes}"
        wanted = f"expected {others}{form} [{vectors.unit}] up to {vectors.largest:g}"
        raise ValueError(f"{wanted}, got {what!r} in {text!r}")
    return tuple(numbers)


def _effect(what: str, known: Sequence[Any], text: str) -> Any:
    """Return the effect of a fault if it is one of the known effects. Raises ValueError."""
    if what not in known:
        raise ValueError(f"expected {' or '.join(known)}, got {what!r} in {text!r}")
    return what


def _imu_part_fault(sensor: ImuPart, what: str, window: Window, text: str) -> Fault:
    """Return the fault of the gyroscope or the accelerometer. Raises ValueError."""
    if what == "frozen":
        return SensorFault(sensor, "frozen", window)
    if what == "lost":
        wanted = f"expected imu=lost, as the imu is lost as a whole, got {text!r}"
        raise ValueError(wanted)
    return BiasJump(sensor, _vector(what, BIASES[sensor], text, "frozen, or "), window)


# ---- parts drawn from the seed ------------------------------------------------------------------


def first_lap(course: Course, vehicle: Vehicle) -> float:
    """Return a rough estimate of the time of the first lap [s].

    The estimate is the time to fly each straight leg between gates from rest, with the acceleration
    that full thrust leaves beside the weight. A racer does not stop at gates, but its path is
    longer and its thrust has to turn the velocity: on split_s_swift the estimate is 4.7 s, and a
    first lap takes 5.1 to 5.3 s.
    """
    acceleration = sqrt(max(vehicle.thrust_max**2 - GRAVITY**2, GRAVITY**2))
    places = [course.start.position, *(gate.position for gate in course.gates)]
    return sum(sqrt(2.0 * dist(a, b) / acceleration) for a, b in pairwise(places))


def drawn(
    faults: Sequence[Fault], seeds: np.random.SeedSequence, latest: float
) -> tuple[Fault, ...]:
    """Return the faults with their omitted parts drawn from the seed.

    Each fault has its own random stream and takes the same number of draws, whatever its kind. So
    the first fault of a seed begins at the same time in every variant, and a second fault does not
    change the first one.

    Args:
        faults: faults; the draws of each depend on its place in the order.
        seeds: the stream of the faults.
        latest: a drawn time lies between 0 and this [s], uniformly.
    """
    return tuple(_drawn(fault, fault_stream(seeds, k), latest) for k, fault in enumerate(faults))


def _drawn(fault: Fault, seeds: np.random.SeedSequence, latest: float) -> Fault:
    rng = np.random.default_rng(seeds)
    start = round(rng.uniform(0.0, latest), DRAWN_DIGITS)
    rotor = int(rng.integers(ROTORS)) + 1
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)

    if fault.window.start is None:
        fault = replace(fault, window=Window(start, fault.window.duration))
    if isinstance(fault, RotorFault) and fault.rotor is None:
        return replace(fault, rotor=rotor)
    if isinstance(fault, BiasJump) and len(fault.jump) == 1:
        jump = np.round(fault.jump[0] * direction, DRAWN_DIGITS)
        return replace(fault, jump=tuple(jump.tolist()))
    if isinstance(fault, VectorFault) and len(fault.vector) == 1:
        # A centre of mass is displaced along x and y alone.
        within = direction[: VECTORS[fault.part].size]
        within = within / np.linalg.norm(within)
        vector = np.round(fault.vector[0] * within, VECTOR_DIGITS)
        return replace(fault, vector=tuple(vector.tolist()))
    return fault
