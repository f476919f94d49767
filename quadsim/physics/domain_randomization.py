"""Domain randomization: start pose, vehicle and gusts of a flight, drawn from its seed.

All changes scale with a size: 0 changes nothing, 1 is a careful outdoor flight. The numbers depend
on seed and size alone, so that two planners with the same seed fly under the same disturbances. The
planner's model remains the model of the nominal vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import radians, sqrt
from typing import NamedTuple

import numpy as np

from quadsim.course import Course, Gate, Start
from quadsim.course.checks import misplaced_gates, start_problems
from quadsim.course.frames import frame_numbers
from quadsim.dynamics.first_order import remaining
from quadsim.files.values import SettingError
from quadsim.rotation import Vec3
from quadsim.vehicle import Vehicle, scale_thrust
from quadsim.vehicle.tolerances import VehicleTolerances

# Half widths of the uniform distributions at size 1: start position per axis [m], start yaw [rad],
# and vehicle parameters, of which flight controller and planner have only the nominal values. A
# vehicle whose file has an uncertainty is drawn from that.
OFFSET = 0.2
TURN = radians(10)
VEHICLE = VehicleTolerances()
# Draws of a start, or of the places of gates, until they pass the checks of a course file
MOST_DRAWS = 100


@dataclass(frozen=True)
class Randomization:
    """Changes of the nominal start and vehicle. Shares are relative: 0.03 is 3 % more."""

    # displacement of the start [m]
    offset: Vec3 = (0.0, 0.0, 0.0)
    # change of the start's yaw [rad]
    turn: float = 0.0
    mass: float = 0.0
    thrust: float = 0.0
    rate_lag: float = 0.0
    motor_lag: float = 0.0
    drag: float = 0.0
    # standard deviation of the gusts per axis [m/s^2]
    gust: float = 0.0

    def start(self, start: Start) -> Start:
        """Return the start, moved and turned."""
        x, y, z = start.position
        dx, dy, dz = self.offset
        return Start((x + dx, y + dy, z + dz), start.yaw + self.turn)

    def vehicle(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle for the actuators, with randomized lags, drag and full thrust."""
        lags = tuple(tau * (1 + self.rate_lag) for tau in vehicle.rate_tau)
        drag = tuple(d * (1 + self.drag) for d in vehicle.drag)
        rotors = vehicle.rotors
        if rotors:
            rotors = replace(rotors, tau=rotors.tau * (1 + self.motor_lag))
        varied = replace(vehicle, rate_tau=lags, rotors=rotors, drag=drag)
        return scale_thrust(varied, 1 + self.thrust)

    def body(self, vehicle: Vehicle) -> Vehicle:
        """Return the vehicle for the rigid body, with randomized mass and inertia.

        The flight controller uses the nominal mass and inertia.
        """
        inertia = tuple(j * (1 + self.mass) for j in vehicle.inertia)
        return replace(vehicle, mass=vehicle.mass * (1 + self.mass), inertia=inertia)


class Widths(NamedTuple):
    """Half widths of the uniform distributions of a vehicle's numbers at size 1, relative."""

    mass: float
    thrust: float
    rate_lag: float
    motor_lag: float
    drag: float


def widths(vehicle: Vehicle | None) -> Widths:
    """Return the half widths of a vehicle: its own uncertainty, if it is known.

    A uniform distribution has the half width sqrt(3) times its standard deviation.
    """
    known = vehicle.uncertainty if vehicle else None
    if known is None:
        lag = VEHICLE.lag
        return Widths(VEHICLE.mass, VEHICLE.thrust, lag, lag, VEHICLE.drag)
    shares = (known.mass, known.thrust, known.rate_lag, known.motor_lag, known.drag)
    return Widths(*(sqrt(3) * share for share in shares))


def draw(
    seeds: np.random.SeedSequence,
    size: float,
    course: Course | None = None,
    start: Start | None = None,
    vehicle: Vehicle | None = None,
) -> Randomization:
    """Return the changes of a flight: uniform distributions, all independent.

    The order in which the numbers are drawn is part of the meaning of a seed. A start in a frame,
    in an obstacle or out of bounds is drawn again, alone.

    Args:
        seeds: the stream of the vehicle.
        size: scale of all changes; 0: none.
        course: the course as it stands; None: any start will do.
        start: the nominal start; None: that of the course.
        vehicle: the nominal vehicle, whose uncertainty is drawn from; None: one without.

    Raises:
        SettingError: no start of MOST_DRAWS has room (a ValueError).
    """
    if size == 0:
        return Randomization()
    rng = np.random.default_rng(seeds)
    dx, dy, dz, turn, mass, thrust, rate_lag, motor_lag, drag = (
        size * rng.uniform(-1, 1, 9)
    ).tolist()
    offset = (OFFSET * dx, OFFSET * dy, OFFSET * dz)
    if course is not None:
        offset = _with_room(offset, size, rng, course, start or course.start)
    width = widths(vehicle)
    return Randomization(
        offset=offset,
        turn=TURN * turn,
        mass=width.mass * mass,
        thrust=width.thrust * thrust,
        rate_lag=width.rate_lag * rate_lag,
        motor_lag=width.motor_lag * motor_lag,
        drag=width.drag * drag,
        gust=VEHICLE.gust * size,
    )


def _with_room(
    offset: Vec3, size: float, rng: np.random.Generator, course: Course, start: Start
) -> Vec3:
    """Return a displacement of the start that has room, the one given if it has. [m]"""
    problem = ""
    for _ in range(MOST_DRAWS):
        moved = Randomization(offset).start(start)
        problem = next(start_problems(course, moved.position), "")
        if not problem:
            return offset
        x, y, z = (OFFSET * size * rng.uniform(-1, 1, 3)).tolist()
        offset = (x, y, z)
    wanted = f"expected room for the vehicle in one of {MOST_DRAWS} starts that are drawn"
    raise SettingError("randomize", f"{wanted}, got none: the last: {problem}")


def gusts(seeds: np.random.SeedSequence, std: float, dt: float) -> Iterator[Vec3]:
    """Yield the acceleration by the wind [m/s^2] in each physics step, world frame.

    The gust is an Ornstein-Uhlenbeck process, exact for any dt and stationary from the first step:

        w <- exp(-dt / tau) w + std sqrt(1 - exp(-2 dt / tau)) N(0, 1)

    Args:
        seeds: the stream of the gusts.
        std: standard deviation per axis [m/s^2].
        dt: physics step [s].
    """
    keep = remaining(VEHICLE.gust_tau, dt)
    fresh = std * sqrt(1 - keep * keep)
    rng = np.random.default_rng(seeds)
    x, y, z = (std * rng.standard_normal(3)).tolist()
    while True:
        yield x, y, z
        a, b, c = rng.standard_normal(3).tolist()
        x = keep * x + fresh * a
        y = keep * y + fresh * b
        z = keep * z + fresh * c


def displaced(course: Course, seeds: np.random.SeedSequence, size: float) -> Course:
    """Return the course with every gate displaced along x and y, uniformly within +-size [m].

    A frame that is flown through several times is moved once. Heights stay, as gates stand on the
    ground, and so that a gate above another stays clear of it. A gate that would stand out of
    bounds, in the start or behind obstacles is drawn again, alone.

    Raises:
        SettingError: a gate finds no place in MOST_DRAWS draws (a ValueError).
    """
    rng = np.random.default_rng(seeds)
    numbers = frame_numbers(course.gates)
    moves = size * rng.uniform(-1, 1, (max(numbers) + 1, 2))  # of each frame
    problems: dict[int, str] = {}
    for _ in range(MOST_DRAWS):
        gates = zip(course.gates, numbers, strict=True)
        moved = replace(course, gates=tuple(_moved(gate, moves[k]) for gate, k in gates))
        problems = misplaced_gates(moved)
        if not problems:
            return moved
        for k in dict.fromkeys(numbers[i] for i in problems):
            moves[k] = size * rng.uniform(-1, 1, 2)
    (i, problem), *_ = problems.items()
    wanted = f"expected a place for gate {i + 1} in one of {MOST_DRAWS} draws"
    raise SettingError("displace_gates", f"{wanted}, got none: the last: {problem}")


def _moved(gate: Gate, move: np.ndarray) -> Gate:
    """Return a gate that is moved along x and y [m]."""
    x, y, z = gate.position
    dx, dy = move.tolist()
    return replace(gate, position=(x + dx, y + dy, z))
