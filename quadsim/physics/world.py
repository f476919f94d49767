"""The PyBullet world: the only file that imports pybullet. Its frames and its xyzw quaternions end
here.

PyBullet caps velocities at 100 (m/s, rad/s) per coordinate, silently; no vehicle here gets near
that.
"""

from __future__ import annotations

import os
from importlib import import_module
from math import dist, hypot
from typing import Any

import numpy as np

from quadsim.course import Course, Gate, Obstacle
from quadsim.course.obstacles import Cylinder
from quadsim.rotation import Quaternion, Vec3, to_body
from quadsim.vehicle import GRAVITY, Vehicle

ORIGIN = (0.0, 0.0, 0.0)
# [m] from the vehicle to the frames that stand in the world, more than any step of the flight
NEAR = 10.0


def _import_quietly(name: str) -> Any:
    """Import a module that prints from C to file descriptor 2, where sys.stderr cannot catch it."""
    stderr, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        return import_module(name)
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(nowhere)


bullet = _import_quietly("pybullet")


class World:
    """A rigid sphere with its own inertia, the ground at z = 0, static frames and obstacles, in a
    client of its own."""

    def __init__(self, course: Course, vehicle: Vehicle, dt: float):
        self._client = bullet.connect(bullet.DIRECT)
        self._at: dict[str, int] = {"physicsClientId": self._client}
        bullet.setTimeStep(dt, **self._at)
        bullet.setGravity(0.0, 0.0, -GRAVITY, **self._at)
        plane = bullet.createCollisionShape(
            bullet.GEOM_PLANE, planeNormal=[0.0, 0.0, 1.0], **self._at
        )
        self._names = {bullet.createMultiBody(0.0, plane, **self._at): "ground"}
        number = {gate: k for k, gate in reversed([*enumerate(course.gates, 1)])}
        # each once, however often a lap leads through it
        self._gates = tuple(dict.fromkeys(course.gates))
        self._numbers = [number[gate] for gate in self._gates]  # of the first time
        self._standing: dict[int, int] = {}  # of those near the vehicle: place in _gates -> body
        self._centres = np.array([gate.position for gate in self._gates])  # (gates, 3)
        self._reach = np.array(
            [NEAR + hypot(*gate.opening) / 2 + 2 * gate.frame_width for gate in self._gates]
        )
        self._place = self._gates_stand_around = ORIGIN
        self._names |= {
            self._add_obstacle(o): f"obstacle {k}" for k, o in enumerate(course.obstacles, 1)
        }
        self._body = self._add_vehicle(vehicle)

    def _put_up_gates(self) -> None:
        """Bullet visits every body in each step, so only the gates around the vehicle stand."""
        self._gates_stand_around = self._place
        away = np.linalg.norm(self._centres - self._place, axis=1) > self._reach
        for k in [k for k in self._standing if away[k]]:
            body = self._standing.pop(k)
            del self._names[body]
            bullet.removeBody(body, **self._at)
        for k in np.flatnonzero(~away).tolist():
            if k not in self._standing:
                self._standing[k] = body = self._add_gate(self._gates[k])
                self._names[body] = f"gate {self._numbers[k]}"

    def _add_gate(self, gate: Gate) -> int:
        """One static compound of boxes. Not a mesh, whose collision shape is its hull: a solid
        opening."""
        # a tuple of rows crashes pybullet
        centres, halves = map(list, zip(*gate.bars, strict=True))
        frame = bullet.createCollisionShapeArray(
            shapeTypes=[bullet.GEOM_BOX] * 4,
            halfExtents=halves,
            collisionFramePositions=centres,
            **self._at,
        )
        attitude = bullet.getQuaternionFromEuler([gate.roll, gate.pitch, gate.yaw], **self._at)
        return bullet.createMultiBody(
            0.0, frame, basePosition=gate.position, baseOrientation=attitude, **self._at
        )

    def _add_obstacle(self, obstacle: Obstacle) -> int:
        if isinstance(obstacle, Cylinder):
            kind, size, yaw = (
                bullet.GEOM_CYLINDER,
                {"radius": obstacle.radius, "height": obstacle.height},
                0.0,
            )
        else:
            kind, size, yaw = bullet.GEOM_BOX, {"halfExtents": obstacle.half}, obstacle.yaw
        shape = bullet.createCollisionShape(kind, **size, **self._at)
        attitude = bullet.getQuaternionFromEuler([0.0, 0.0, yaw], **self._at)
        return bullet.createMultiBody(
            0.0, shape, basePosition=obstacle.centre, baseOrientation=attitude, **self._at
        )

    def _add_vehicle(self, vehicle: Vehicle) -> int:
        sphere = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=vehicle.radius, **self._at)
        body = bullet.createMultiBody(vehicle.mass, sphere, **self._at)
        bullet.changeDynamics(
            body,
            -1,
            localInertiaDiagonal=vehicle.inertia,
            linearDamping=0.0,  # the default 0.04 would slow 12 m/s down by 6 m/s^2
            angularDamping=0.0,
            restitution=0.0,
            **self._at,
        )
        return body

    def place(self, p: Vec3, q: Quaternion, v: Vec3 = ORIGIN, omega: Vec3 = ORIGIN) -> None:
        """Put the vehicle there: q wxyz, v and omega in the world frame [m/s, rad/s]."""
        w, x, y, z = q
        bullet.resetBasePositionAndOrientation(self._body, p, (x, y, z, w), **self._at)
        bullet.resetBaseVelocity(self._body, v, omega, **self._at)
        self._place = p
        self._put_up_gates()

    def apply(self, force_body: Vec3, torque_body: Vec3) -> None:
        """Act for the next step only [N, N m]; gravity is added by Bullet."""
        bullet.applyExternalForce(self._body, -1, force_body, ORIGIN, bullet.LINK_FRAME, **self._at)
        bullet.applyExternalTorque(self._body, -1, torque_body, bullet.LINK_FRAME, **self._at)

    def step(self) -> None:
        """Velocities first, then poses with the new velocities. Then contacts, else they would lag
        one step."""
        if dist(self._place, self._gates_stand_around) > NEAR / 2:
            self._put_up_gates()
        bullet.stepSimulation(**self._at)
        bullet.performCollisionDetection(**self._at)

    def read(self) -> tuple[Vec3, Vec3, Quaternion, Vec3]:
        """p [m], v [m/s] in the world frame, q wxyz, omega [rad/s] in the body frame."""
        p, (x, y, z, w) = bullet.getBasePositionAndOrientation(self._body, **self._at)
        v, omega = bullet.getBaseVelocity(self._body, **self._at)
        q = (w, x, y, z)
        self._place = p
        return p, v, q, to_body(q, omega)

    def contacts(self) -> tuple[str, ...]:
        """What the vehicle touches now. Bullet also lists near pairs, at positive distance: those
        are left out."""
        points = bullet.getContactPoints(bodyA=self._body, **self._at)
        return tuple(dict.fromkeys(self._names[c[2]] for c in points if c[8] <= 0.0))

    def close(self) -> None:
        if bullet.isConnected(**self._at):
            bullet.disconnect(**self._at)
