"""A rigid sphere with its own inertia: the world of a plant without PyBullet.

    v <- v + (R(q) f / m - g e_z) dt                    p <- p + v dt
    omega <- omega + J^-1 (tau - omega x J omega) dt    q <- q x exp((0, omega) dt / 2)

The integrator is semi-implicit Euler in Bullet's order: velocities by the forces of the step, then
poses by the new velocities. A scheme of higher order would be closer to the differential equations,
but not to Bullet; with this scheme the two plants differ only by rounding.

Contacts are found by the referee's swept test. The ground stops a fall, without bounce and without
friction. Contacts with frames and obstacles are only reported: they end a flight, or cost a penalty
in the timed mode, in which the vehicle flies through the object. Several vehicles in a RigidArena
collide without bounce and friction: after a collision they have a common velocity along the line
between their centres, by the conservation of momentum.
"""

from __future__ import annotations

from itertools import combinations
from math import dist

from quadsim.course import Course
from quadsim.course.swept import SweptGates, first_within, lerp
from quadsim.course.swept_obstacles import SweptObstacles
from quadsim.dynamics.rate_torque import gyroscopic
from quadsim.rotation import Quaternion, Vec3, to_body, to_world, turned_at
from quadsim.vehicle import GRAVITY, Vehicle

ORIGIN: Vec3 = (0.0, 0.0, 0.0)


class RigidBody:
    """One vehicle above the ground at z = 0, among a course's gates and obstacles."""

    def __init__(self, course: Course, vehicle: Vehicle, dt: float):
        """Make a vehicle in a course's world, stepped every dt [s]."""
        self.vehicle = vehicle
        self._dt = dt
        self.removed = False
        self._gates = SweptGates(course.gates, vehicle.radius)
        self._obstacles = SweptObstacles(course.obstacles, vehicle.radius)
        self._force: Vec3 = ORIGIN
        self._torque: Vec3 = ORIGIN
        self.place(ORIGIN, (1.0, 0.0, 0.0, 0.0))

    def place(self, p: Vec3, q: Quaternion, v: Vec3 = ORIGIN, omega: Vec3 = ORIGIN) -> None:
        """Put the vehicle at a pose.

        Args:
            p: position [m].
            q: attitude, wxyz.
            v: velocity in the world frame [m/s].
            omega: angular velocity in the world frame [rad/s].
        """
        self._p = p
        self._q = q
        self._v = v
        self._omega: Vec3 = to_body(q, omega)
        # position before the last step [m]
        self.before = p
        self._contacts: tuple[str, ...] = ()

    def apply(self, force_body: Vec3, torque_body: Vec3) -> None:
        """Apply a force [N] and a torque [N m] for the next step only; gravity is added here."""
        self._force = force_body
        self._torque = torque_body

    def step(self) -> None:
        """Advance velocities, then poses by the new velocities, then find contacts in between."""
        dt = self._dt
        mass = self.vehicle.mass

        fx, fy, fz = to_world(self._q, self._force)
        vx, vy, vz = self._v
        vx = vx + dt * fx / mass
        vy = vy + dt * fy / mass
        vz = vz + dt * (fz / mass - GRAVITY)
        self._omega = self._next_body_rates()

        self._q = turned_at(self._q, self._omega, dt)
        before = self._p
        self.before = before
        x = before[0] + dt * vx
        y = before[1] + dt * vy
        z = before[2] + dt * vz

        # The ground stops a fall.
        lowest = self.vehicle.radius
        grounded = z <= lowest
        self._p = (x, y, max(z, lowest))
        self._v = (vx, vy, max(vz, 0.0) if grounded else vz)

        ground = ("ground",) if grounded else ()
        self._contacts = ground + self._touched(before, self._p)
        self._force = ORIGIN
        self._torque = ORIGIN

    def _next_body_rates(self) -> Vec3:
        """Return the body rates after the step [rad/s], by Euler's equation."""
        dt = self._dt
        wx, wy, wz = self._omega
        tx, ty, tz = self._torque
        gx, gy, gz = gyroscopic(self._omega, self.vehicle.inertia)
        jx, jy, jz = self.vehicle.inertia
        return wx + dt * (tx - gx) / jx, wy + dt * (ty - gy) / jy, wz + dt * (tz - gz) / jz

    def read(self) -> tuple[Vec3, Vec3, Quaternion, Vec3]:
        """Return p [m], v [m/s] in the world frame, q wxyz, omega [rad/s] in the body frame."""
        return self._p, self._v, self._q, self._omega

    def contacts(self) -> tuple[str, ...]:
        """Return the objects touched in the last step, e.g. "ground", "gate 3", "obstacle 2"."""
        return self._contacts

    @property
    def position(self) -> Vec3:
        """The position [m]."""
        return self._p

    @property
    def velocity(self) -> Vec3:
        """The velocity in the world frame [m/s]."""
        return self._v

    def touch(self, name: str, position: Vec3, velocity: Vec3) -> None:
        """Record a contact within the last step, and replace the state at the end of the step.

        Args:
            name: name of the touched object, such as "vehicle 2".
            position: position at the end of the step [m].
            velocity: velocity at the end of the step, world frame [m/s].
        """
        x, y, z = position
        self._p = (x, y, max(z, self.vehicle.radius))
        self._v = velocity
        self._contacts = (*self._contacts, name)

    def remove(self) -> None:
        """Remove the vehicle from its arena, so that others cannot touch it any more."""
        self.removed = True

    def close(self) -> None:
        """Do nothing, as there are no resources to release."""

    def _touched(self, p0: Vec3, p1: Vec3) -> tuple[str, ...]:
        """Return the names of gates and obstacles that the sphere touches between p0 and p1 [m]."""
        touched = []
        for swept in self._gates.near(p0, p1):
            contact = swept.touch(swept.gate.to_local(p0), swept.gate.to_local(p1))
            if contact is not None:
                touched.append(f"gate {swept.index + 1}")
        touched += [incident.touched for incident in self._obstacles.incidents(p0, p1)]
        return tuple(touched)


class RigidArena:
    """Several rigid bodies above one ground, among one course's gates and obstacles."""

    def __init__(self, course: Course, dt: float, collide: bool = True):
        """Make a world without vehicles.

        Args:
            course: gates and obstacles.
            dt: physics step [s].
            collide: whether vehicles collide; otherwise they pass through each other.
        """
        self._course = course
        self._dt = dt
        self._collide = collide
        self._bodies: list[RigidBody] = []

    def add(self, vehicle: Vehicle) -> RigidBody:
        """Add a vehicle, and return it; the first one is "vehicle 1" in the contacts of others."""
        body = RigidBody(self._course, vehicle, self._dt)
        self._bodies.append(body)
        return body

    def step(self) -> None:
        """Advance all vehicles by one physics step, then resolve their collisions."""
        flying = [(k, body) for k, body in enumerate(self._bodies, 1) if not body.removed]
        for _, body in flying:
            body.step()
        if self._collide:
            for (k, a), (m, b) in combinations(flying, 2):
                reach = a.vehicle.radius + b.vehicle.radius
                s = first_within(a.before, a.position, b.before, b.position, reach)
                if s is not None:
                    self._collide_at(s, (k, a), (m, b))

    def _collide_at(
        self, s: float, first: tuple[int, RigidBody], other: tuple[int, RigidBody]
    ) -> None:
        """Resolve the collision of two vehicles.

        Args:
            s: fraction of the step at which the two touch.
            first, other: numbers and bodies of the two vehicles.
        """
        k, a = first
        m, b = other

        # The unit vector between the centres at the contact
        at_a = lerp(a.before, a.position, s)
        at_b = lerp(b.before, b.position, s)
        distance = dist(at_a, at_b)
        if distance == 0.0:
            return
        normal = _scaled(_less(at_b, at_a), 1.0 / distance)

        # The impulse per unit of reduced mass that cancels the approach speed
        approach = max(_dot(_less(a.velocity, b.velocity), normal), 0.0)
        total = a.vehicle.mass + b.vehicle.mass
        v_a = _less(a.velocity, _scaled(normal, approach * b.vehicle.mass / total))
        v_b = _less(b.velocity, _scaled(normal, -approach * a.vehicle.mass / total))

        # After the contact the vehicles move with their new velocities.
        left = (1.0 - s) * self._dt
        a.touch(f"vehicle {m}", _less(at_a, _scaled(v_a, -left)), v_a)
        b.touch(f"vehicle {k}", _less(at_b, _scaled(v_b, -left)), v_b)

    def close(self) -> None:
        """Do nothing, as there are no resources to release."""


def _less(a: Vec3, b: Vec3) -> Vec3:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _scaled(a: Vec3, factor: float) -> Vec3:
    """Return factor a."""
    return factor * a[0], factor * a[1], factor * a[2]


def _dot(a: Vec3, b: Vec3) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
