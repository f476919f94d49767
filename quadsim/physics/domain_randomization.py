"""Domain randomization: start pose, vehicle and gusts of a flight, drawn from its seed.

All changes scale with a size: 0 changes nothing, 1 is a careful outdoor flight. The numbers depend
on seed and size alone, so that two planners with the same seed fly under the same disturbances. The
planner's model remains the model of the nominal vehicle.
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

# Half widths of the uniform distributions at size 1: start position per axis [m], start yaw [rad],
# and vehicle parameters, of which flight controller and planner have only the nominal values.
OFFSET = 0.2
TURN = radians(10)
VEHICLE = VehicleTolerances()


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


def draw(seeds: np.random.SeedSequence, size: float) -> Randomization:
    """Draw the changes of a flight from independent uniform distributions.

    The order of the draws must not change, as it decides the meaning of a seed.

    Args:
        seeds: the stream of the vehicle.
        size: scale of all changes; 0: none.
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

    A gate with several passes is moved once. Heights stay, as gates stand on the ground, and to
    keep stacked gates clear of each other.
    """
    distinct = tuple(dict.fromkeys(course.gates))
    moves = size * np.random.default_rng(seeds).uniform(-1, 1, (len(distinct), 2))
    moved = {}
    for gate, (dx, dy) in zip(distinct, moves.tolist(), strict=True):
        x, y, z = gate.position
        moved[gate] = replace(gate, position=(x + dx, y + dy, z))
    return replace(course, gates=tuple(moved[gate] for gate in course.gates))
