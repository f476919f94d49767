"""Plants: what is flown. The controller plans with a model of it, which may differ.

A quadrotor is a rigid body behind its actuators; two worlds move the rigid body, PyBullet's and our own. Any other
system is flown by its own step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from math import cos, sin
from typing import Protocol

import numpy as np

from quadsim.course import Course, Start
from quadsim.physics.actuators import Actuators, Vector, to_body
from quadsim.physics.rigid_body import RigidBody
from quadsim.vehicle import GRAVITY, Vehicle

CLEARANCE = 1e-3  # between the ground and a vehicle that starts on it [m]


@dataclass(frozen=True, slots=True)
class PlantState:
    """The state after a physics step."""

    t: float  # [s]
    x: Vector  # STATE
    contacts: tuple[str, ...]  # what the vehicle touches: "ground", "gate 3"

    @property
    def position(self) -> tuple[float, float, float]:
        """Of a state that begins with one [m]; a state of fewer than three numbers is filled up with zeros."""
        x, y, z = (*self.x[:3], 0.0, 0.0)[:3]
        return x, y, z


class Plant(Protocol):
    """A system with its own fixed physics step. One for each flight; close() frees it."""

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


class World(Protocol):
    """A rigid body among a course's gates; see quadsim.physics.rigid_body.RigidBody."""

    def place(self, p: Vector, q: Vector) -> None: ...
    def apply(self, force_body: Vector, torque_body: Vector) -> None: ...
    def step(self) -> None: ...
    def read(self) -> tuple[Vector, Vector, Vector, Vector]: ...
    def contacts(self) -> tuple[str, ...]: ...
    def close(self) -> None: ...


class RigidPlant:
    """A rigid body, moved by quadsim.physics.rigid_body, behind the vehicle's actuators.

    Deterministic: each plant has a world of its own.
    """

    def __init__(
        self,
        course: Course,
        vehicle: Vehicle,
        dt: float = 1 / 400,
        start: Start | None = None,
        body: Vehicle | None = None,
        gusts: Iterator[Vector] | None = None,
    ):
        """start: in place of the course's own. body: whose mass and inertia the world has, in place of the vehicle's,
        by which the actuators are controlled. gusts: acceleration of each physics step, world frame [m/s^2]."""
        self.dt = dt
        self._actuators = Actuators(vehicle, dt)
        self._world = self._new_world(course, body or vehicle, dt)
        self._mass, self._gusts = (body or vehicle).mass, gusts
        x = start_state(start or course.start, vehicle.radius)
        self._world.place(x[0:3], x[6:10])
        self._steps = 0
        self.state = self._read()

    @staticmethod
    def _new_world(course: Course, body: Vehicle, dt: float) -> World:
        return RigidBody(course, body, dt)

    def step(self, u: Vector) -> PlantState:
        x = self.state.x
        force, torque = self._actuators.wrench(u, x[10:13], to_body(x[6:10], x[3:6]))
        if self._gusts:
            gust = to_body(x[6:10], next(self._gusts))
            force = tuple(f + self._mass * a for f, a in zip(force, gust, strict=True))
        self._world.apply(force, torque)
        self._world.step()
        self._steps += 1
        self.state = self._read()
        return self.state

    def _read(self) -> PlantState:
        p, v, q, omega = self._world.read()
        x = (*p, *v, *q, *omega, self._actuators.thrust, *self._actuators.angular_acceleration)
        return PlantState(self._steps * self.dt, x, self._world.contacts())

    def close(self) -> None:
        self._world.close()


class BulletPlant(RigidPlant):
    """The same in PyBullet. Raises ValueError where that is not installed."""

    @staticmethod
    def _new_world(course: Course, body: Vehicle, dt: float) -> World:
        if not has_bullet():
            raise ValueError("plant: 'bullet' needs PyBullet, which is not installed: install it, or fly 'rigid'")
        from quadsim.physics import world  # here, so that models and referees do not load pybullet

        return world.World(course, body, dt)


PLANTS: dict[str, type[RigidPlant]] = {"bullet": BulletPlant, "rigid": RigidPlant}


def has_bullet() -> bool:
    """Whether PyBullet can be imported; it is not, as that takes a while."""
    return find_spec("pybullet") is not None


def default_plant() -> str:
    """The plant that is flown unless another is asked for: "bullet" where PyBullet is installed, else "rigid"."""
    return "bullet" if has_bullet() else "rigid"


class ModelPlant:
    """A system flown by its own step, with an optional disturbance. Touches nothing."""

    def __init__(
        self,
        step: Callable[[Vector, Vector, Vector, float], Vector],
        params: Vector,
        x0: Vector,
        dt: float,
        disturb: Callable[[Vector], Vector] | None = None,
    ):
        """disturb: a change of the state after each step, e.g. `diffusion`."""
        self.dt = dt
        self._step, self._params, self._disturb = step, params, disturb
        self._steps = 0
        self.state = PlantState(0.0, x0, ())

    def step(self, u: Vector) -> PlantState:
        x = self._step(self.state.x, u, self._params, self.dt)
        self._steps += 1
        self.state = PlantState(self._steps * self.dt, self._disturb(x) if self._disturb else x, ())
        return self.state

    def close(self) -> None:
        pass


def diffusion(std: Vector, dt: float, rng: np.random.Generator) -> Callable[[Vector], Vector]:
    """Brownian disturbance: x_i += std_i sqrt(dt) N(0, 1) each step, so std_i is reached after 1 s for any dt."""
    scale = np.asarray(std) * np.sqrt(dt)
    return lambda x: tuple((x + scale * rng.standard_normal(len(scale))).tolist())
