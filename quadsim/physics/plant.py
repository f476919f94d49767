"""Plants: the simulated vehicle. The controller's model of the vehicle may differ from the plant.

A quadrotor is a rigid body that is moved by its actuators. The rigid body is simulated by PyBullet
or by quadsim.physics.rigid_body. Two other simulators, RotorPy and Crazyflow, bring their own
multirotors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from importlib.util import find_spec
from typing import Any, Literal, Protocol

from quadsim.course import Course, Start
from quadsim.dynamics.quadrotor import State
from quadsim.physics.actuators import Actuators, Wrench
from quadsim.physics.crazyflow_plant import CrazyflowPlant
from quadsim.physics.faults import FaultOfVehicle
from quadsim.physics.plant_state import MotorUse, PlantState, start_state
from quadsim.physics.rigid_body import RigidArena, RigidBody
from quadsim.physics.rotorpy_plant import RotorpyPlant
from quadsim.rotation import Quaternion, Vec3, to_body
from quadsim.vehicle import Vehicle


class Plant(Protocol):
    """A vehicle with its own fixed physics step.

    Each flight has its own plant. A plant may have `velocity_lag` [s]: the time by which the
    velocity of its states is older than the position.

    Examples:
        >>> import quadsim
        >>> from quadsim.physics.plant import RigidPlant
        >>> class Sideways(RigidPlant):
        ...     def step(self, u):
        ...         wx, wy, wz, thrust = u
        ...         return super().step((wx + 0.2, wy, wz, thrust))  # a bias of the gyro
        >>> def plant(spec):
        ...     return Sideways(spec.course, spec.vehicle, spec.plant_dt)
        >>> run = quadsim.fly("figure8", plant=plant, laps=1, samples=256)
        >>> run.outcome
        'finished'
    """

    # physics step [s]
    dt: float

    @property
    def state(self) -> PlantState[Any]:
        """The state after the last physics step."""
        ...

    def step(self, u: Sequence[float]) -> PlantState[Any]:
        """Advance by one physics step and return the state after it.

        Args:
            u: command, for a quadrotor in the order of Control  (n_u,).
        """
        ...

    def close(self) -> None:
        """Release the resources of the plant."""
        ...


class World(Protocol):
    """A rigid body among a course's gates; see quadsim.physics.rigid_body.RigidBody.

    If the body is a member of an Arena, `step` and `close` act on the whole arena.
    """

    def place(self, p: Vec3, q: Quaternion) -> None:
        """Put the vehicle at rest at the position p [m] with the attitude q (wxyz)."""
        ...

    def apply(self, force_body: Vec3, torque_body: Vec3) -> None:
        """Apply a force [N] and a torque [N m], in the body frame, during the next step only."""
        ...

    def step(self) -> None:
        """Advance by one physics step."""
        ...

    def read(self) -> tuple[Vec3, Vec3, Quaternion, Vec3]:
        """Return p [m], v [m/s] in the world frame, q wxyz, omega [rad/s] in the body frame."""
        ...

    def contacts(self) -> tuple[str, ...]:
        """Return the objects touched in the last step, e.g. "ground", "gate 3", "obstacle 2"."""
        ...

    def close(self) -> None:
        """Release the resources of the world."""
        ...


class Member(World, Protocol):
    """One of several vehicles in an Arena."""

    def remove(self) -> None:
        """Remove the vehicle, so that others cannot touch it any more."""
        ...


class Arena(Protocol):
    """A world of several vehicles; see quadsim.physics.rigid_body.RigidArena."""

    def add(self, vehicle: Vehicle) -> Member:
        """Add a vehicle, and return it; the first one is "vehicle 1" in the contacts of others."""
        ...

    def step(self) -> None:
        """Advance all vehicles by one physics step."""
        ...

    def close(self) -> None:
        """Release the resources of the arena."""
        ...


def new_arena(plant: str, course: Course, dt: float, collide: bool) -> Arena:
    """Return a world without vehicles for several plants of this kind.

    Args:
        plant: "bullet" or "rigid".
        course: gates and obstacles that stand in the world.
        dt: physics step [s].
        collide: whether vehicles collide; otherwise they pass through each other.

    Raises:
        ValueError: PyBullet is not installed.
    """
    if plant == "rigid":
        return RigidArena(course, dt, collide)
    _expect_bullet()
    # imported here, so that models and referees do not load pybullet
    from quadsim.physics import world

    return world.BulletArena(course, dt, collide)


class ActuatorsProtocol(Protocol):
    """Converts a command to a wrench; see quadsim.physics.actuators.Actuators."""

    # thrust delivered along body z, mass-normalised [m/s^2]
    thrust: float
    # angular acceleration delivered, body frame [rad/s^2]
    angular_acceleration: Vec3

    @property
    def use(self) -> MotorUse | None:
        """The use of the motors in the flight; None if no firmware commands them."""
        ...

    def wrench(
        self, command: Sequence[float], omega_body: Vec3, v_body: Vec3, attitude: Quaternion
    ) -> Wrench:
        """Return the wrench on the body for the step that starts now."""
        ...

    def close(self) -> None:
        """Release the resources of the actuators."""
        ...


# (vehicle, dt, faults of rotors) -> the actuators
ActuatorsFactory = Callable[[Vehicle, float, Sequence[FaultOfVehicle]], ActuatorsProtocol]


class RigidPlant:
    """A vehicle that is simulated by its actuators and quadsim.physics.rigid_body.

    Each plant has its own world, so that the same commands give the same states.
    """

    def __init__(
        self,
        course: Course,
        vehicle: Vehicle,
        dt: float = 1 / 400,
        start: Start | None = None,
        body: Vehicle | None = None,
        gusts: Iterator[Vec3] | None = None,
        faults: Sequence[FaultOfVehicle] = (),
        actuators: ActuatorsFactory = Actuators,
    ):
        """Start at rest.

        Args:
            course: gates and obstacles that stand in the world.
            vehicle: vehicle that has the actuators.
            dt: physics step [s].
            start: the start; None: the course's start.
            body: vehicle whose mass and inertia the world uses; None: `vehicle`. The flight
                controller always uses the mass and inertia of `vehicle`.
            gusts: acceleration in each physics step, world frame [m/s^2].
            faults: faults of the vehicle, with nothing left to draw.
            actuators: function of vehicle, dt and faults that makes the actuators.
        """
        body = body or vehicle
        self.dt = dt
        # Semi-implicit Euler sets p <- p + v dt, so v is the velocity in the middle of the step.
        self.velocity_lag = dt / 2
        self._actuators = actuators(vehicle, dt, faults)
        self._world = self._new_world(course, body, dt)
        self._mass = body.mass
        self._gusts = gusts
        x = start_state(start or course.start, vehicle.radius)
        self._world.place(x.position, x.attitude)
        self._steps = 0
        self.state = self._read()

    def _new_world(self, course: Course, body: Vehicle, dt: float) -> World:
        return RigidBody(course, body, dt)

    def step(self, u: Sequence[float]) -> PlantState[State]:
        """Advance by one physics step under a command in the order of Control  (4,)."""
        self.push(u)
        self._world.step()
        return self.arrive()

    def push(self, u: Sequence[float], disturbance: Vec3 | None = None) -> None:
        """Apply the forces of the next physics step.

        Args:
            u: command in the order of Control  (4,).
            disturbance: force by other vehicles, such as downwash, world frame [N].
        """
        x = self.state.x
        attitude = x.attitude
        v_body = to_body(attitude, x.velocity)
        force, torque = self._actuators.wrench(u, x.body_rates, v_body, attitude)
        if self._gusts:
            fx, fy, fz = force
            ax, ay, az = to_body(attitude, next(self._gusts))
            force = (fx + self._mass * ax, fy + self._mass * ay, fz + self._mass * az)
        if disturbance:
            fx, fy, fz = force
            dx, dy, dz = to_body(attitude, disturbance)
            force = (fx + dx, fy + dy, fz + dz)
        self._world.apply(force, torque)

    def arrive(self) -> PlantState[State]:
        """Return the state after a physics step of the world."""
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
        t = self._steps * self.dt
        return PlantState(t, x, self._world.contacts(), self._actuators.use)

    def close(self) -> None:
        """Release the world and the actuators."""
        self._world.close()
        self._actuators.close()


class SharedPlant(RigidPlant):
    """One of several vehicles in an Arena.

    The owner of the arena calls `push` of all plants before a step of the arena, and `arrive` of
    all plants after it.
    """

    def __init__(self, arena: Arena, *args: Any, **settings: Any):
        """Start at rest.

        Args:
            arena: the shared world.
            args, settings: further arguments of RigidPlant.
        """
        self._arena = arena
        super().__init__(*args, **settings)

    def _new_world(self, course: Course, body: Vehicle, dt: float) -> World:
        self._member = self._arena.add(body)
        return self._member

    def remove(self) -> None:
        """Remove the vehicle from the arena, so that others cannot touch it any more."""
        self._member.remove()

    def close(self) -> None:
        """Release the actuators; the owner of the arena closes the arena."""
        self._actuators.close()


class BulletPlant(RigidPlant):
    """A RigidPlant that PyBullet simulates. Raises ValueError if PyBullet is not installed."""

    def _new_world(self, course: Course, body: Vehicle, dt: float) -> World:
        _expect_bullet()
        # imported here, so that models and referees do not load pybullet
        from quadsim.physics import world

        return world.BulletWorld(course, body, dt)


PlantName = Literal["bullet", "rigid", "rotorpy", "crazyflow"]
PLANTS: dict[PlantName, type[RigidPlant] | type[RotorpyPlant] | type[CrazyflowPlant]] = {
    "bullet": BulletPlant,
    "rigid": RigidPlant,
    "rotorpy": RotorpyPlant,
    "crazyflow": CrazyflowPlant,
}


def _expect_bullet() -> None:
    """Raise ValueError if PyBullet is not installed."""
    if not has_bullet():
        raise ValueError(
            "plant: 'bullet' needs PyBullet, which is not installed: install it, or fly 'rigid'"
        )


def has_bullet() -> bool:
    """Return whether PyBullet is installed, without importing it."""
    return find_spec("pybullet") is not None


def default_plant() -> PlantName:
    """Return the default plant: "bullet" if PyBullet is installed, else "rigid"."""
    return "bullet" if has_bullet() else "rigid"
