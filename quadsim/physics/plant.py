"""Plant: the world that is flown. The controller only believes; the plant is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import cos, sin
from typing import Protocol

import numpy as np

from quadsim.course import FRAME_DEPTH, Course, Start
from quadsim.physics.actuators import Actuators, Vector, to_body
from quadsim.vehicle import GRAVITY, Vehicle

CLEARANCE = 1e-3  # between the ground and a vehicle that starts on it [m]


@dataclass(frozen=True, slots=True)
class PlantState:
    """What one physics step left behind."""

    t: float  # [s]
    x: Vector  # STATE
    contacts: tuple[str, ...]  # what the vehicle touches: "ground", "gate 3"

    @property
    def position(self) -> tuple[float, float, float]:
        """Of a state that begins with one [m]; a state of fewer than three numbers is filled up with zeros."""
        x, y, z = (*self.x[:3], 0.0, 0.0)[:3]
        return x, y, z


class Plant(Protocol):
    """A world with its own clock of fixed physics steps. One per flight; close() frees it."""

    dt: float  # physics step [s]

    @property
    def state(self) -> PlantState: ...

    def step(self, u: Vector) -> PlantState:
        """Advance one physics step under the command u = (body rates [rad/s], thrust [m/s^2])."""
        ...

    def close(self) -> None: ...


def start_state(start: Start, radius: float) -> Vector:
    """At rest, level, hover thrust; lifted clear of the ground where the start stands on it.  (17,)"""
    x, y, z = start.position
    half = 0.5 * start.yaw
    p = (x, y, max(z, radius + CLEARANCE))
    return (*p, 0.0, 0.0, 0.0, cos(half), 0.0, 0.0, sin(half), 0.0, 0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0)


class BulletPlant:
    """A rigid body in PyBullet behind the vehicle's actuators. Deterministic: each plant has a fresh client."""

    def __init__(
        self,
        course: Course,
        vehicle: Vehicle,
        dt: float = 1 / 400,
        start: Start | None = None,
        body: Vehicle | None = None,
        gusts: Iterator[Vector] | None = None,
    ):
        """start: where to stand instead of on the course's own start. body: whose mass and inertia the actuators, who
        know only the vehicle, really move. gusts: acceleration of each physics step, world frame [m/s^2]."""
        from quadsim.physics.world import World  # here, so that models and referees do not load pybullet

        self.dt = dt
        self._actuators = Actuators(vehicle, dt)
        self._world = World(course, body or vehicle, dt, FRAME_DEPTH)
        self._mass, self._gusts = (body or vehicle).mass, gusts
        x = start_state(start or course.start, vehicle.radius)
        self._world.place(x[0:3], x[6:10])
        self._steps = 0
        self._state = self._read()

    @property
    def state(self) -> PlantState:
        return self._state

    def step(self, u: Vector) -> PlantState:
        x = self._state.x
        force, torque = self._actuators.wrench(u, x[10:13], to_body(x[6:10], x[3:6]))
        if self._gusts:
            gust = to_body(x[6:10], next(self._gusts))
            force = tuple(f + self._mass * a for f, a in zip(force, gust, strict=True))
        self._world.apply(force, torque)
        self._world.step()
        self._steps += 1
        self._state = self._read()
        return self._state

    def _read(self) -> PlantState:
        p, v, q, omega = self._world.read()
        x = (*p, *v, *q, *omega, self._actuators.thrust, *self._actuators.angular_acceleration)
        return PlantState(self._steps * self.dt, x, self._world.contacts())

    def close(self) -> None:
        self._world.close()


class ModelPlant:
    """A system's own step as the world, with an optional disturbance. Touches nothing."""

    def __init__(
        self,
        step: Callable[[Vector, Vector, Vector, float], Vector],
        params: Vector,
        x0: Vector,
        dt: float,
        disturb: Callable[[Vector], Vector] | None = None,
    ):
        """disturb: what the world does to the state after each step, e.g. `diffusion`."""
        self.dt = dt
        self._step, self._params, self._disturb = step, params, disturb
        self._steps = 0
        self._state = PlantState(0.0, x0, ())

    @property
    def state(self) -> PlantState:
        return self._state

    def step(self, u: Vector) -> PlantState:
        x = self._step(self._state.x, u, self._params, self.dt)
        self._steps += 1
        self._state = PlantState(self._steps * self.dt, self._disturb(x) if self._disturb else x, ())
        return self._state

    def close(self) -> None:
        pass


def diffusion(std: Vector, dt: float, rng: np.random.Generator) -> Callable[[Vector], Vector]:
    """Brownian disturbance: x_i += std_i sqrt(dt) N(0, 1) each step, so std_i is reached after 1 s for any dt."""
    scale = np.asarray(std) * np.sqrt(dt)
    return lambda x: tuple((x + scale * rng.standard_normal(len(scale))).tolist())
