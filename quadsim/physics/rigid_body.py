"""A rigid sphere with its own inertia, integrated here: the world of a plant where PyBullet is not installed.

    v <- v + (R(q) f / m - g e_z) dt                    p <- p + v dt
    omega <- omega + J^-1 (tau - omega x J omega) dt    q <- q x exp((0, omega) dt / 2)

Semi-implicit Euler, in Bullet's order: velocities by the forces of the step, then poses by the new velocities. A
scheme of higher order would be nearer to the differential equations, but farther from the other plant: in this order
the two differ by rounding alone, and a flight in one of them says the same as in the other.

Contacts are the referee's swept test. The ground stops a fall, without bounce and without friction; a gate's frame and
an obstacle are reported only, as touching one ends a flight, and where penalties are asked for the vehicle flies on
through it.
"""

from __future__ import annotations

from math import cos, hypot, sin

from quadsim.course import Course
from quadsim.course.swept import SweptGates
from quadsim.course.swept_obstacles import SweptObstacles
from quadsim.physics.actuators import Vector, gyroscopic
from quadsim.systems.quadrotor import quaternion_rate
from quadsim.systems.rotation import to_body, to_world
from quadsim.vehicle import GRAVITY, Vec3, Vehicle

ORIGIN: Vec3 = (0.0, 0.0, 0.0)


class RigidBody:
    """One vehicle above the ground at z = 0, among a course's gates and obstacles."""

    def __init__(self, course: Course, vehicle: Vehicle, dt: float):
        self._vehicle, self._dt = vehicle, dt
        self._gates = SweptGates(course.gates, vehicle.radius)
        self._obstacles = SweptObstacles(course.obstacles, vehicle.radius)
        self._force: Vector = ORIGIN
        self._torque: Vector = ORIGIN
        self.place(ORIGIN, (1.0, 0.0, 0.0, 0.0))

    def place(self, p: Vector, q: Vector, v: Vector = ORIGIN, omega: Vector = ORIGIN) -> None:
        """Put the vehicle there: q wxyz, v and omega in the world frame [m/s, rad/s]."""
        x, y, z = p
        self._p, self._q, self._v, self._omega = (x, y, z), q, v, to_body(q, omega)
        self._contacts: tuple[str, ...] = ()

    def apply(self, force_body: Vector, torque_body: Vector) -> None:
        """Act for the next step only [N, N m]; gravity is added here."""
        self._force, self._torque = force_body, torque_body

    def step(self) -> None:
        """Velocities first, then poses with the new velocities, then contacts on the way."""
        dt, mass, inertia = self._dt, self._vehicle.mass, self._vehicle.inertia
        fx, fy, fz = to_world(self._q, self._force)
        (vx, vy, vz), before = self._v, self._p
        vx, vy, vz = vx + dt * fx / mass, vy + dt * fy / mass, vz + dt * (fz / mass - GRAVITY)
        held = zip(self._omega, self._torque, gyroscopic(self._omega, inertia), inertia, strict=True)
        self._omega = tuple(w + dt * (t - g) / j for w, t, g, j in held)
        self._q = turned(self._q, self._omega, dt)
        x, y, z = before[0] + dt * vx, before[1] + dt * vy, before[2] + dt * vz
        lowest = self._vehicle.radius
        grounded = z <= lowest
        self._p = (x, y, max(z, lowest))
        self._v = (vx, vy, max(vz, 0.0) if grounded else vz)
        self._contacts = (("ground",) if grounded else ()) + self._touched(before, self._p)
        self._force = self._torque = ORIGIN

    def read(self) -> tuple[Vec3, Vector, Vector, Vector]:
        """p [m], v [m/s] in the world frame, q wxyz, omega [rad/s] in the body frame."""
        return self._p, self._v, self._q, self._omega

    def contacts(self) -> tuple[str, ...]:
        """What the vehicle touched in the last step: "ground", "gate 3", "obstacle 2"."""
        return self._contacts

    def close(self) -> None:
        """Nothing is held."""

    def _touched(self, p0: Vec3, p1: Vec3) -> tuple[str, ...]:
        hit = (g for g in self._gates.near(p0, p1) if g.touch(g.gate.to_local(p0), g.gate.to_local(p1)) is not None)
        return (*(f"gate {g.index + 1}" for g in hit), *(i.touched for i in self._obstacles.incidents(p0, p1)))


def turned(q: Vector, omega: Vector, dt: float) -> Vector:
    """q x exp((0, omega) dt / 2), of unit length: after dt at constant body rates omega [rad/s]."""
    rate = hypot(*omega)
    s = sin(0.5 * rate * dt) / rate if rate > 0.0 else 0.5 * dt
    r, turn = cos(0.5 * rate * dt), quaternion_rate(q, tuple(s * w for w in omega))
    product = tuple(r * a + b for a, b in zip(q, turn, strict=True))
    length = hypot(*product)
    return tuple(v / length for v in product)
