"""Plants: what is flown. The controller plans with a model of it, which may differ.

A quadrotor is a rigid body behind its actuators; two worlds move the rigid body, PyBullet's and our own. Another
simulator, RotorPy, has a multirotor of its own. Any other system is flown by its own step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import Protocol

import numpy as np

from quadsim.course import Course, Start
from quadsim.physics.actuators import Actuators, Vector
from quadsim.physics.plant_state import PlantState, start_state
from quadsim.physics.rigid_body import RigidBody
from quadsim.physics.rotorpy_plant import RotorpyPlant
from quadsim.systems.rotation import to_body
from quadsim.vehicle import Vehicle


class Plant(Protocol):
    """A system with its own fixed physics step. One for each flight; close() frees it."""

    dt: float  # physics step [s]
    # A plant may have `velocity_lag` [s]: how much older than the position the velocity of its states is.

    @property
    def state(self) -> PlantState: ...

    def step(self, u: Vector) -> PlantState:
        """Advance one physics step under the command u = (body rates [rad/s], thrust [m/s^2])."""
        ...

    def close(self) -> None: ...


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
        self.velocity_lag = dt / 2  # semi-implicit Euler: p <- p + v dt, so that v is of the middle of the step
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


PLANTS: dict[str, type[RigidPlant] | type[RotorpyPlant]] = {
    "bullet": BulletPlant,
    "rigid": RigidPlant,
    "rotorpy": RotorpyPlant,
}


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
