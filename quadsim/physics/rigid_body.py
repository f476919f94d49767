"""A rigid sphere with its own inertia, integrated here: the world of a plant where PyBullet is not
installed.

    v <- v + (R(q) f / m - g e_z) dt                    p <- p + v dt
    omega <- omega + J^-1 (tau - omega x J omega) dt    q <- q x exp((0, omega) dt / 2)

Semi-implicit Euler, in Bullet's order: velocities by the forces of the step, then poses by the new
velocities. A scheme of higher order would be nearer to the differential equations, but farther from
the other plant: in this order the two differ by rounding alone, and a flight in one of them says
the same as in the other.

Contacts are the referee's swept test. The ground stops a fall, without bounce and without friction;
a gate's frame and an obstacle are reported only, as touching one ends a flight, and where penalties
are asked for the vehicle flies on through it.
"""

from __future__ import annotations

from quadsim.course import Course
from quadsim.course.swept import SweptGates
from quadsim.course.swept_obstacles import SweptObstacles
from quadsim.physics.actuators import gyroscopic
from quadsim.rotation import Quaternion, Vec3, to_body, to_world, turned_at
from quadsim.vehicle import GRAVITY, Vehicle

ORIGIN: Vec3 = (0.0, 0.0, 0.0)


class RigidBody:
    """One vehicle above the ground at z = 0, among a course's gates and obstacles."""

    def __init__(self, course: Course, vehicle: Vehicle, dt: float):
        self._vehicle, self._dt = vehicle, dt
        self._gates = SweptGates(course.gates, vehicle.radius)
        self._obstacles = SweptObstacles(course.obstacles, vehicle.radius)
        self._force: Vec3 = ORIGIN
        self._torque: Vec3 = ORIGIN
        self.place(ORIGIN, (1.0, 0.0, 0.0, 0.0))

    def place(self, p: Vec3, q: Quaternion, v: Vec3 = ORIGIN, omega: Vec3 = ORIGIN) -> None:
        """Put the vehicle there: q wxyz, v and omega in the world frame [m/s, rad/s]."""
        self._p = p
        self._q = q
        self._v = v
        self._omega: Vec3 = to_body(q, omega)
        self._contacts: tuple[str, ...] = ()

    def apply(self, force_body: Vec3, torque_body: Vec3) -> None:
        """Act for the next step only [N, N m]; gravity is added here."""
        self._force, self._torque = force_body, torque_body

    def step(self) -> None:
        """Velocities first, then poses with the new velocities, then contacts on the way."""
        dt, mass = self._dt, self._vehicle.mass
        fx, fy, fz = to_world(self._q, self._force)
        vx, vy, vz = self._v
        vx = vx + dt * fx / mass
        vy = vy + dt * fy / mass
        vz = vz + dt * (fz / mass - GRAVITY)
        self._omega = self._turning_on()
        self._q = turned_at(self._q, self._omega, dt)
        before = self._p
        x, y, z = before[0] + dt * vx, before[1] + dt * vy, before[2] + dt * vz
        lowest = self._vehicle.radius
        grounded = z <= lowest
        self._p = (x, y, max(z, lowest))
        self._v = (vx, vy, max(vz, 0.0) if grounded else vz)
        self._contacts = (("ground",) if grounded else ()) + self._touched(before, self._p)
        self._force = self._torque = ORIGIN

    def _turning_on(self) -> Vec3:
        """Return the body rates after the step [rad/s], by Euler's equation."""
        dt = self._dt
        wx, wy, wz = self._omega
        tx, ty, tz = self._torque
        gx, gy, gz = gyroscopic(self._omega, self._vehicle.inertia)
        jx, jy, jz = self._vehicle.inertia
        return wx + dt * (tx - gx) / jx, wy + dt * (ty - gy) / jy, wz + dt * (tz - gz) / jz

    def read(self) -> tuple[Vec3, Vec3, Quaternion, Vec3]:
        """p [m], v [m/s] in the world frame, q wxyz, omega [rad/s] in the body frame."""
        return self._p, self._v, self._q, self._omega

    def contacts(self) -> tuple[str, ...]:
        """What the vehicle touched in the last step: "ground", "gate 3", "obstacle 2"."""
        return self._contacts

    def close(self) -> None:
        """Nothing is held."""

    def _touched(self, p0: Vec3, p1: Vec3) -> tuple[str, ...]:
        hit = (
            g
            for g in self._gates.near(p0, p1)
            if g.touch(g.gate.to_local(p0), g.gate.to_local(p1)) is not None
        )
        return (
            *(f"gate {g.index + 1}" for g in hit),
            *(i.touched for i in self._obstacles.incidents(p0, p1)),
        )
