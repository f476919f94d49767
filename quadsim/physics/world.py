"""The PyBullet world; no other file imports pybullet.

PyBullet's frames and its xyzw quaternions are used only in this file. PyBullet silently clips
velocities at 100 (m/s, rad/s) per coordinate, which no vehicle here approaches.
"""

from __future__ import annotations

import os
from importlib import import_module
from math import dist, hypot
from typing import Any

import numpy as np

from quadsim.course import Course, Gate, Obstacle
from quadsim.course.frames import frames
from quadsim.course.obstacles import Cylinder
from quadsim.rotation import Quaternion, Vec3, to_body
from quadsim.vehicle import GRAVITY, Vehicle

ORIGIN = (0.0, 0.0, 0.0)
# [m] Gates within this distance of the vehicle are added to the world; larger than any step
NEAR = 10.0


def _import_quietly(name: str) -> Any:
    """Import a module that prints from C to file descriptor 2, where sys.stderr cannot catch it."""
    stderr = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        return import_module(name)
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(nowhere)


bullet = _import_quietly("pybullet")

# Places in a contact point of Bullet.
OTHER_BODY = 2
CONTACT_DISTANCE = 8


class BulletArena:
    """A world with the ground at z = 0, gates, obstacles, and one vehicle or several.

    A vehicle is a rigid sphere with its own inertia. Each arena has its own Bullet client.
    """

    def __init__(self, course: Course, dt: float, collide: bool = True):
        """Make a world without vehicles.

        Args:
            course: gates and obstacles that stand in the world.
            dt: physics step [s].
            collide: whether vehicles collide; otherwise they pass through each other.
        """
        self._client = bullet.connect(bullet.DIRECT)
        self.at: dict[str, int] = {"physicsClientId": self._client}
        bullet.setTimeStep(dt, **self.at)
        bullet.setGravity(0.0, 0.0, -GRAVITY, **self.at)
        plane = bullet.createCollisionShape(
            bullet.GEOM_PLANE, planeNormal=[0.0, 0.0, 1.0], **self.at
        )
        # body -> its name in contacts
        self.names = {bullet.createMultiBody(0.0, plane, **self.at): "ground"}

        # Each frame is added once, with the number of its first pass.
        self._gates = frames(course.gates)
        self._numbers = tuple(course.gates.index(gate) + 1 for gate in self._gates)
        # gates near a vehicle: place in _gates -> body
        self._standing: dict[int, int] = {}
        self._centres = np.array([gate.position for gate in self._gates])  # (gates, 3)
        self._reach = np.array(
            [NEAR + hypot(*gate.opening) / 2 + 2 * gate.frame_width for gate in self._gates]
        )
        for number, obstacle in enumerate(course.obstacles, 1):
            self.names[self._add_obstacle(obstacle)] = f"obstacle {number}"
        self._collide = collide
        self._bodies: list[Body] = []

    def add(self, vehicle: Vehicle) -> Body:
        """Add a vehicle, and return it."""
        return Body(self, vehicle)

    def enter(self, body: Body) -> None:
        """Register a vehicle for contacts; the first one is "vehicle 1"."""
        if not self._collide:
            for other in self._bodies:
                bullet.setCollisionFilterPair(other.number, body.number, -1, -1, 0, **self.at)
        self._bodies.append(body)
        self.names[body.number] = f"vehicle {len(self._bodies)}"

    def put_up_gates(self) -> None:
        """Keep only gates near vehicles in the world, because Bullet visits every body."""
        away = np.ones(len(self._gates), bool)
        for body in self._bodies:
            body.gates_stand_around = body.place_now
            if not body.removed:
                distances = np.linalg.norm(self._centres - body.place_now, axis=1)
                away &= distances > self._reach
        for k in [k for k in self._standing if away[k]]:
            body = self._standing.pop(k)
            del self.names[body]
            bullet.removeBody(body, **self.at)
        for k in np.flatnonzero(~away).tolist():
            if k not in self._standing:
                body = self._add_gate(self._gates[k])
                self._standing[k] = body
                self.names[body] = f"gate {self._numbers[k]}"

    def _add_gate(self, gate: Gate) -> int:
        """Add a gate as one static compound of boxes, and return its body.

        A mesh would collide by its convex hull, which closes the opening.
        """
        # A tuple of rows crashes pybullet.
        centres = [bar.centre for bar in gate.bars]
        halves = [bar.half for bar in gate.bars]
        frame = bullet.createCollisionShapeArray(
            shapeTypes=[bullet.GEOM_BOX] * 4,
            halfExtents=halves,
            collisionFramePositions=centres,
            **self.at,
        )
        attitude = bullet.getQuaternionFromEuler([gate.roll, gate.pitch, gate.yaw], **self.at)
        return bullet.createMultiBody(
            0.0, frame, basePosition=gate.position, baseOrientation=attitude, **self.at
        )

    def _add_obstacle(self, obstacle: Obstacle) -> int:
        """Add a static obstacle and return its body."""
        if isinstance(obstacle, Cylinder):
            shape = bullet.createCollisionShape(
                bullet.GEOM_CYLINDER, radius=obstacle.radius, height=obstacle.height, **self.at
            )
            yaw = 0.0
        else:
            shape = bullet.createCollisionShape(
                bullet.GEOM_BOX, halfExtents=obstacle.half, **self.at
            )
            yaw = obstacle.yaw
        attitude = bullet.getQuaternionFromEuler([0.0, 0.0, yaw], **self.at)
        return bullet.createMultiBody(
            0.0, shape, basePosition=obstacle.centre, baseOrientation=attitude, **self.at
        )

    def step(self) -> None:
        """Advance velocities, then poses by the new velocities, then find contacts.

        The extra search for contacts is needed because Bullet reports contacts one step late.
        """
        if any(dist(b.place_now, b.gates_stand_around) > NEAR / 2 for b in self._bodies):
            self.put_up_gates()
        bullet.stepSimulation(**self.at)
        bullet.performCollisionDetection(**self.at)

    def close(self) -> None:
        """Disconnect from Bullet."""
        if bullet.isConnected(**self.at):
            bullet.disconnect(**self.at)


class Body:
    """One vehicle in a BulletArena: a sphere without damping."""

    def __init__(self, arena: BulletArena, vehicle: Vehicle):
        """Add a vehicle to an arena."""
        self._arena = arena
        self._at = arena.at
        self.removed = False
        # position of the vehicle now, and when gates were last put up [m]
        self.place_now = ORIGIN
        self.gates_stand_around = ORIGIN
        sphere = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=vehicle.radius, **self._at)
        # Bullet's number of the body
        self.number: int = bullet.createMultiBody(vehicle.mass, sphere, **self._at)
        bullet.changeDynamics(
            self.number,
            -1,
            localInertiaDiagonal=vehicle.inertia,
            # the default damping of 0.04 would decelerate 12 m/s by 6 m/s^2
            linearDamping=0.0,
            angularDamping=0.0,
            restitution=0.0,
            **self._at,
        )
        arena.enter(self)

    def remove(self) -> None:
        """Remove the vehicle from the arena, so that others cannot touch it any more."""
        if not self.removed:
            self.removed = True
            bullet.removeBody(self.number, **self._at)

    def place(self, p: Vec3, q: Quaternion, v: Vec3 = ORIGIN, omega: Vec3 = ORIGIN) -> None:
        """Put the vehicle at a pose.

        Args:
            p: position [m].
            q: attitude, wxyz.
            v: velocity in the world frame [m/s].
            omega: angular velocity in the world frame [rad/s].
        """
        w, x, y, z = q
        bullet.resetBasePositionAndOrientation(self.number, p, (x, y, z, w), **self._at)
        bullet.resetBaseVelocity(self.number, v, omega, **self._at)
        self.place_now = p
        self._arena.put_up_gates()

    def apply(self, force_body: Vec3, torque_body: Vec3) -> None:
        """Apply a force [N] and a torque [N m] for the next step only; Bullet adds gravity."""
        frame = bullet.LINK_FRAME
        bullet.applyExternalForce(self.number, -1, force_body, ORIGIN, frame, **self._at)
        bullet.applyExternalTorque(self.number, -1, torque_body, frame, **self._at)

    def step(self) -> None:
        """Advance the whole arena by one physics step."""
        self._arena.step()

    def read(self) -> tuple[Vec3, Vec3, Quaternion, Vec3]:
        """Return p [m], v [m/s] in the world frame, q wxyz, omega [rad/s] in the body frame."""
        p, (x, y, z, w) = bullet.getBasePositionAndOrientation(self.number, **self._at)
        v, omega = bullet.getBaseVelocity(self.number, **self._at)
        q = (w, x, y, z)
        self.place_now = p
        return p, v, q, to_body(q, omega)

    def contacts(self) -> tuple[str, ...]:
        """Return the objects that the vehicle touches: "ground", "gate 3", "vehicle 2".

        Bullet also lists pairs that are only near each other, which are left out.
        """
        points = bullet.getContactPoints(bodyA=self.number, **self._at)
        touching = [point for point in points if point[CONTACT_DISTANCE] <= 0.0]
        names = self._arena.names
        return tuple(dict.fromkeys(names[point[OTHER_BODY]] for point in touching))

    def close(self) -> None:
        """Release the whole arena."""
        self._arena.close()


class BulletWorld(Body):
    """One vehicle in its own BulletArena."""

    def __init__(self, course: Course, vehicle: Vehicle, dt: float):
        """Make a world with one vehicle.

        Args:
            course: gates and obstacles that stand in the world.
            vehicle: mass, inertia and radius of the vehicle.
            dt: physics step [s].
        """
        super().__init__(BulletArena(course, dt), vehicle)
