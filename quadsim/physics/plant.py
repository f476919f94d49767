"""Plants: what is flown. The controller plans with a model of it, which may differ.

A quadrotor is a rigid body behind its actuators; two worlds move the rigid body, PyBullet's and our
own. Another simulator, RotorPy, has a multirotor of its own. Any other system is flown by its own
step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import Any, Literal, Protocol

import numpy as np

from quadsim.course import Course, Start
from quadsim.dynamics import System
from quadsim.dynamics.quadrotor import State
from quadsim.physics.actuators import Actuators
from quadsim.physics.plant_state import PlantState, start_state
from quadsim.physics.rigid_body import RigidBody
from quadsim.physics.rotorpy_plant import RotorpyPlant
from quadsim.rotation import Quaternion, Vec3, to_body
from quadsim.vehicle import Vehicle

Vector = tuple[float, ...]  # a state or the parameters of any system


class Plant(Protocol):
    """A system with its own fixed physics step. One for each flight; close() frees it."""

    dt: float  # physics step [s]
    # A plant may have `velocity_lag` [s]: how much older than the position the velocity of its
    # states is.

    @property
    def state(self) -> PlantState[Any]: ...

    def step(self, u: Sequence[float]) -> PlantState[Any]:
        """Advance one physics step under the command u, of a quadrotor in the order of Control."""
        ...

    def close(self) -> None: ...


class World(Protocol):
    """A rigid body among a course's gates; see quadsim.physics.rigid_body.RigidBody."""

    def place(self, p: Vec3, q: Quaternion) -> None: ...
    def apply(self, force_body: Vec3, torque_body: Vec3) -> None: ...
    def step(self) -> None: ...
    def read(self) -> tuple[Vec3, Vec3, Quaternion, Vec3]: ...
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
        gusts: Iterator[Vec3] | None = None,
    ):
        """start: in place of the course's own. body: whose mass and inertia the world has, in place
        of the vehicle's, by which the actuators are controlled. gusts: acceleration of each physics
        step, world frame [m/s^2]."""
        self.dt = dt
        # semi-implicit Euler: p <- p + v dt, so that v is of the middle of the step
        self.velocity_lag = dt / 2
        self._actuators = Actuators(vehicle, dt)
        self._world = self._new_world(course, body or vehicle, dt)
        self._mass, self._gusts = (body or vehicle).mass, gusts
        x = start_state(start or course.start, vehicle.radius)
        self._world.place(x.position, x.attitude)
        self._steps = 0
        self.state = self._read()

    @staticmethod
    def _new_world(course: Course, body: Vehicle, dt: float) -> World:
        return RigidBody(course, body, dt)

    def step(self, u: Sequence[float]) -> PlantState[State]:
        x = self.state.x
        attitude = x.attitude
        force, torque = self._actuators.wrench(u, x.body_rates, to_body(attitude, x.velocity))
        if self._gusts:
            fx, fy, fz = force
            ax, ay, az = to_body(attitude, next(self._gusts))
            force = fx + self._mass * ax, fy + self._mass * ay, fz + self._mass * az
        self._world.apply(force, torque)
        self._world.step()
        self._steps += 1
        self.state = self._read()
        return self.state

    def _read(self) -> PlantState[State]:
        position, velocity, attitude, body_rates = self._world.read()
        x = State.of(
            position,
            velocity,
            attitude,
            body_rates,
            self._actuators.thrust,
            self._actuators.angular_acceleration,
        )
        return PlantState(self._steps * self.dt, x, self._world.contacts())

    def close(self) -> None:
        self._world.close()


class BulletPlant(RigidPlant):
    """The same in PyBullet. Raises ValueError where that is not installed."""

    @staticmethod
    def _new_world(course: Course, body: Vehicle, dt: float) -> World:
        if not has_bullet():
            raise ValueError(
                "plant: 'bullet' needs PyBullet, which is not installed: install it, or fly 'rigid'"
            )
        from quadsim.physics import world  # here, so that models and referees do not load pybullet

        return world.World(course, body, dt)


PlantName = Literal["bullet", "rigid", "rotorpy"]
PLANTS: dict[PlantName, type[RigidPlant] | type[RotorpyPlant]] = {
    "bullet": BulletPlant,
    "rigid": RigidPlant,
    "rotorpy": RotorpyPlant,
}


def has_bullet() -> bool:
    """Whether PyBullet can be imported; it is not, as that takes a while."""
    return find_spec("pybullet") is not None


def default_plant() -> PlantName:
    """The plant that is flown unless another is asked for: "bullet" where PyBullet is installed,
    else "rigid"."""
    return "bullet" if has_bullet() else "rigid"


class NamedPlant:
    """A quadrotor's plant of a user's own, whose states may be plain tuples of 17 numbers in the
    order of `State`.

    The same plant, with a `State` in place of the tuple: sensors and records read its numbers by
    name.
    """

    def __init__(self, plant: Plant):
        self._plant = plant
        self.dt = plant.dt
        self.velocity_lag = getattr(plant, "velocity_lag", 0.0)

    @property
    def state(self) -> PlantState[State]:
        return named(self._plant.state)

    def step(self, u: Sequence[float]) -> PlantState[State]:
        return named(self._plant.step(u))

    def close(self) -> None:
        self._plant.close()


def named(state: PlantState[Any]) -> PlantState[State]:
    """Return the same state with its numbers by name. Raises ValueError unless there are as many as
    State has."""
    if isinstance(state.x, State):
        return state
    if len(state.x) != len(State._fields):
        raise ValueError(
            f"plant: expected a state of {len(State._fields)} numbers, got {len(state.x)}"
        )
    return PlantState(state.t, State(*state.x), state.contacts)


class ModelPlant:
    """A system flown by its own step, with an optional disturbance. Touches nothing."""

    def __init__(
        self, system: System, x0: Sequence[float], disturb: Callable[[Vector], Vector] | None = None
    ):
        """Start at the state x0 (n_x,).

        Args:
            system: flown in steps of its dt.
            x0: state at the start.
            disturb: changes the state after each step, e.g. `diffusion`.
        """
        self.dt = system.dt
        self._system = system
        self._disturb = disturb
        self._steps = 0
        self.state: PlantState[Any] = PlantState(0.0, system.state(*x0), ())

    def step(self, u: Sequence[float]) -> PlantState[Any]:
        x = self._system.next(self.state.x, u)
        if self._disturb:
            x = self._system.state(*self._disturb(x))
        self._steps += 1
        self.state = PlantState(self._steps * self.dt, x, ())
        return self.state

    def close(self) -> None:
        pass


def diffusion(std: Vector, dt: float, rng: np.random.Generator) -> Callable[[Vector], Vector]:
    """Brownian disturbance: x_i += std_i sqrt(dt) N(0, 1) each step, so std_i is reached after 1 s
    for any dt."""
    scale = np.asarray(std) * np.sqrt(dt)
    return lambda x: tuple((x + scale * rng.standard_normal(len(scale))).tolist())
