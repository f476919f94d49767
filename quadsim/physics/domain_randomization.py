"""Domain randomization: start pose, vehicle tolerances and gusts, drawn from the plant's own random
stream.

Everything is in proportion to a size: 0 changes nothing, 1 is a careful outdoor flight. What is
drawn depends on seed and size alone, so that two planners with the same seed fly under the same
disturbances. The planner's model remains that of the nominal vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import radians, sqrt

import numpy as np

from quadsim.course import Course, Start
from quadsim.dynamics.first_order import remaining
from quadsim.rotation import Vec3
from quadsim.vehicle import Vehicle, scale_thrust
from quadsim.vehicle.tolerances import VehicleTolerances

# Half widths of the uniform distributions at size 1.
OFFSET = 0.2  # of the start, per axis [m]
TURN = radians(10)  # of its yaw [rad]
VEHICLE = VehicleTolerances()  # of its numbers, which neither flight controller nor planner is told


@dataclass(frozen=True)
class Randomization:
    """What one randomized seed changes of the nominal start and vehicle. Shares are relative, 0.03
    is 3 % more."""

    offset: Vec3 = (0.0, 0.0, 0.0)  # [m]
    turn: float = 0.0  # [rad]
    mass: float = 0.0
    thrust: float = 0.0
    rate_lag: float = 0.0
    motor_lag: float = 0.0
    drag: float = 0.0
    gust: float = 0.0  # standard deviation per axis [m/s^2]

    def start(self, start: Start) -> Start:
        (x, y, z), (dx, dy, dz) = start.position, self.offset
        return Start((x + dx, y + dy, z + dz), start.yaw + self.turn)

    def vehicle(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle whose actuators fly, with its lags, drag and full thrust."""
        lags = tuple(tau * (1 + self.rate_lag) for tau in vehicle.rate_tau)
        rotors = vehicle.rotors and replace(
            vehicle.rotors, tau=vehicle.rotors.tau * (1 + self.motor_lag)
        )
        drag = tuple(d * (1 + self.drag) for d in vehicle.drag)
        return scale_thrust(
            replace(vehicle, rate_tau=lags, rotors=rotors, drag=drag), 1 + self.thrust
        )

    def body(self, vehicle: Vehicle) -> Vehicle:
        """The body that the wrench acts on, with its mass and inertia, which the flight controller
        does not know."""
        inertia = tuple(j * (1 + self.mass) for j in vehicle.inertia)
        return replace(vehicle, mass=vehicle.mass * (1 + self.mass), inertia=inertia)


def draw(seeds: np.random.SeedSequence, size: float) -> Randomization:
    """Return what these seeds change at this size: uniform distributions, all independent.

    The order in which the numbers are drawn is part of what a seed means.
    """
    if size == 0:
        return Randomization()
    drawn = (size * np.random.default_rng(seeds).uniform(-1, 1, 9)).tolist()
    dx, dy, dz, turn, mass, thrust, rate_lag, motor_lag, drag = drawn
    return Randomization(
        offset=(OFFSET * dx, OFFSET * dy, OFFSET * dz),
        turn=TURN * turn,
        mass=VEHICLE.mass * mass,
        thrust=VEHICLE.thrust * thrust,
        rate_lag=VEHICLE.lag * rate_lag,
        motor_lag=VEHICLE.lag * motor_lag,
        drag=VEHICLE.drag * drag,
        gust=VEHICLE.gust * size,
    )


def gusts(seeds: np.random.SeedSequence, std: float, dt: float) -> Iterator[Vec3]:
    """Acceleration [m/s^2] of every physics step: an Ornstein-Uhlenbeck process, exact for any dt,
    stationary from the first step on.

    w <- exp(-dt / tau) w + std sqrt(1 - exp(-2 dt / tau)) N(0, 1)
    """
    keep = remaining(VEHICLE.gust_tau, dt)
    fresh = std * sqrt(1 - keep * keep)
    rng = np.random.default_rng(seeds)
    x, y, z = (std * rng.standard_normal(3)).tolist()
    while True:
        yield x, y, z
        a, b, c = rng.standard_normal(3).tolist()
        x, y, z = keep * x + fresh * a, keep * y + fresh * b, keep * z + fresh * c


def displaced(course: Course, seeds: np.random.SeedSequence, size: float) -> Course:
    """The course with every gate up to `size` [m] off along x and along y, uniformly.

    A gate that is flown through several times is moved once. Heights stay, as gates stand on the
    ground: so one above another stays clear of it.
    """
    distinct = tuple(dict.fromkeys(course.gates))
    moves = size * np.random.default_rng(seeds).uniform(-1, 1, (len(distinct), 2))
    moved = {}
    for gate, (dx, dy) in zip(distinct, moves.tolist(), strict=True):
        x, y, z = gate.position
        moved[gate] = replace(gate, position=(x + dx, y + dy, z))
    return replace(course, gates=tuple(moved[gate] for gate in course.gates))
