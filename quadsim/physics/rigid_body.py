"""A rigid sphere with its own inertia: the world of a plant where PyBullet is not installed.

    v <- v + (R(q) f / m - g e_z) dt                    p <- p + v dt
    omega <- omega + J^-1 (tau - omega x J omega) dt    q <- q x exp((0, omega) dt / 2)

The integrator is semi-implicit Euler in Bullet's order: velocities by the forces of the step, then
poses by the new velocities. A scheme of higher order would be nearer to the differential equations,
but farther from the other plant: in this order the two differ by rounding alone, and a flight in
one of them shows the same as in the other.

Contacts are the referee's swept test. The ground stops a fall, without bounce and without friction.
A gate's frame and an obstacle are reported only: touching one ends a flight, or costs a penalty in
the timed mode, where the vehicle flies on through it.
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
        """dt: physics step [s]."""
        self._vehicle = vehicle
        self._dt = dt
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
        self._contacts: tuple[str, ...] = ()

    def apply(self, force_body: Vec3, torque_body: Vec3) -> None:
        """Apply a force [N] and a torque [N m] for the next step only; gravity is added here."""
        self._force = force_body
        self._torque = torque_body

    def step(self) -> None:
        """Advance velocities, then poses by the new velocities, then find contacts on the way."""
        dt = self._dt
        mass = self._vehicle.mass

        fx, fy, fz = to_world(self._q, self._force)
        vx, vy, vz = self._v
        vx = vx + dt * fx / mass
        vy = vy + dt * fy / mass
        vz = vz + dt * (fz / mass - GRAVITY)
        self._omega = self._next_body_rates()

        self._q = turned_at(self._q, self._omega, dt)
        before = self._p
        x = before[0] + dt * vx
        y = before[1] + dt * vy
        z = before[2] + dt * vz

        # The ground stops a fall.
        lowest = self._vehicle.radius
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
        gx, gy, gz = gyroscopic(self._omega, self._vehicle.inertia)
        jx, jy, jz = self._vehicle.inertia
        return wx + dt * (tx - gx) / jx, wy + dt * (ty - gy) / jy, wz + dt * (tz - gz) / jz

    def read(self) -> tuple[Vec3, Vec3, Quaternion, Vec3]:
        """Return p [m], v [m/s] in the world frame, q wxyz, omega [rad/s] in the body frame."""
        return self._p, self._v, self._q, self._omega

    def contacts(self) -> tuple[str, ...]:
        """Return the objects touched in the last step, e.g. "ground", "gate 3", "obstacle 2"."""
        return self._contacts

    def close(self) -> None:
        """Do nothing, as nothing is held."""

    def _touched(self, p0: Vec3, p1: Vec3) -> tuple[str, ...]:
        """Return the gates and obstacles that are touched on the way from p0 to p1."""
        touched = []
        for swept in self._gates.near(p0, p1):
            contact = swept.touch(swept.gate.to_local(p0), swept.gate.to_local(p1))
            if contact is not None:
                touched.append(f"gate {swept.index + 1}")
        touched += [incident.touched for incident in self._obstacles.incidents(p0, p1)]
        return tuple(touched)
