"""A course drawn by PyBullet's TinyRenderer, to compare the pictures of quadsim.render with."""

from __future__ import annotations

import tempfile
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from quadsim.course import Course, Gate
from quadsim.course.frames import frames
from quadsim.course.obstacles import Cylinder, Obstacle
from quadsim.physics.world import bullet
from quadsim.render.look import Look, Paint, textures
from quadsim.render.scene import GROUND_ID, LAST_GATE, OBSTACLE, SKY, Picture
from quadsim.rotation import Quaternion, Vec3
from quadsim.sensing.camera import Camera

# near and far clipping planes [m]
NEAR = 0.05
FAR = 400.0
GROUND = 600.0  # half the ground's edge [m]
TILE = 8.0  # edge of one tile of the ground's texture [m]


class _Body(NamedTuple):
    """A body of the scene."""

    number: int  # number in PyBullet
    links: set[int]  # links with a visual shape


class Scene:
    """The gates, the obstacles and the ground of a course, in its own PyBullet client.

    close() frees the client.

    Args:
        course: gates and obstacles.
        camera: the camera that takes the pictures.

    Raises:
        ValueError: the course has more gates than 8 bits can number.
    """

    def __init__(self, course: Course, camera: Camera):
        self.course = course
        # each once, however often a lap leads through it
        gates = frames(course.gates)
        if len(gates) > LAST_GATE:
            raise ValueError(f"{course.name}: expected at most {LAST_GATE} gates, got {len(gates)}")
        self._camera = camera
        self._client = bullet.connect(bullet.DIRECT)
        self._at: dict[str, int] = {"physicsClientId": self._client}
        self._ground = self._body(self._add_ground())
        self._gates = [self._body(self._add_gate(gate)) for gate in gates]
        self._obstacles = [self._body(self._add_obstacle(one)) for one in course.obstacles]
        # numbers in the segmentation of the bodies 0, 1, ..., and of -1, the background
        gate_ids = [course.gates.index(gate) + 1 for gate in gates]
        obstacle_ids = [OBSTACLE] * len(course.obstacles)
        self._ids = np.array([GROUND_ID, *gate_ids, *obstacle_ids, SKY], np.uint8)
        self._textures = self._load_textures()

    def shoot(self, p: Vec3, q: Quaternion, look: Look) -> Picture:
        """Return the picture of a vehicle's camera, without the vehicle itself.

        Args:
            p: position of the vehicle [m].
            q: attitude of the vehicle, wxyz.
            look: paint, light and sky.
        """
        self._dress(look)
        position, axes = self._camera.pose(p, q)
        answer = bullet.getCameraImage(
            self._camera.width,
            self._camera.height,
            _view(position, axes),
            _projection(self._camera),
            lightDirection=look.light.towards,
            lightColor=look.light.colour,
            lightAmbientCoeff=look.light.ambient,
            lightDiffuseCoeff=look.light.diffuse,
            lightSpecularCoeff=0.0,
            shadow=0,  # TinyRenderer's shadows are too coarse for gates on wide ground
            renderer=bullet.ER_TINY_RENDERER,
            **self._at,
        )
        _, _, colours, depth_buffer, bodies = answer
        shape = (self._camera.height, self._camera.width)
        rgb = np.reshape(colours, (*shape, 4))[..., :3].astype(np.uint8)
        segmentation = self._ids[np.reshape(bodies, shape)]
        # Convert OpenGL's depth buffer, 0 at NEAR and 1 at FAR, to a distance
        buffer = np.reshape(depth_buffer, shape)
        depth = np.float32(FAR * NEAR) / (np.float32(FAR) - np.float32(FAR - NEAR) * buffer)

        # TinyRenderer draws no sky
        depth[segmentation == SKY] = np.inf
        return Picture(rgb, depth, segmentation)

    def close(self) -> None:
        """Close the PyBullet client; later calls do nothing."""
        if bullet.isConnected(**self._at):
            bullet.disconnect(**self._at)

    def _body(self, number: int) -> _Body:
        """Return the body of this number."""
        shapes = bullet.getVisualShapeData(number, **self._at)
        return _Body(number, {link for _, link, *_ in shapes})

    def _add_ground(self) -> int:
        """Add a square at height 0 and return its number."""
        edge = GROUND
        tiles = 2 * GROUND / TILE
        square = bullet.createVisualShape(
            bullet.GEOM_MESH,
            vertices=[
                [-edge, -edge, 0.0],
                [edge, -edge, 0.0],
                [edge, edge, 0.0],
                [-edge, edge, 0.0],
            ],
            indices=[0, 1, 2, 0, 2, 3],
            uvs=[[0, 0], [tiles, 0], [tiles, tiles], [0, tiles]],
            normals=[[0, 0, 1]] * 4,
            **self._at,
        )
        return bullet.createMultiBody(0.0, -1, square, **self._at)

    def _add_gate(self, gate: Gate) -> int:
        """Add the four bars of a frame and return their number."""
        frame = bullet.createVisualShapeArray(
            shapeTypes=[bullet.GEOM_BOX] * 4,
            halfExtents=[half for _, half in gate.bars],
            visualFramePositions=[centre for centre, _ in gate.bars],
            **self._at,
        )
        attitude = bullet.getQuaternionFromEuler([gate.roll, gate.pitch, gate.yaw], **self._at)
        return bullet.createMultiBody(
            0.0, -1, frame, basePosition=gate.position, baseOrientation=attitude, **self._at
        )

    def _add_obstacle(self, obstacle: Obstacle) -> int:
        """Add an obstacle and return its number."""
        if isinstance(obstacle, Cylinder):
            yaw = 0.0
            shape = bullet.createVisualShape(
                bullet.GEOM_CYLINDER,
                radius=obstacle.radius,
                length=obstacle.height,
                **self._at,
            )
        else:
            yaw = obstacle.yaw
            shape = bullet.createVisualShape(bullet.GEOM_BOX, halfExtents=obstacle.half, **self._at)
        attitude = bullet.getQuaternionFromEuler([0.0, 0.0, yaw], **self._at)
        return bullet.createMultiBody(
            0.0, -1, shape, basePosition=obstacle.centre, baseOrientation=attitude, **self._at
        )

    def _load_textures(self) -> list[int]:
        """Load each texture once, and return their numbers.

        PyBullet reads a texture from a file and never releases it.
        """
        with tempfile.TemporaryDirectory() as folder:
            paths = [Path(folder) / f"{i}.png" for i in range(len(textures()))]
            for path, pixels in zip(paths, textures(), strict=True):
                Image.fromarray(pixels).save(path)
            return [bullet.loadTexture(str(path), **self._at) for path in paths]

    def _dress(self, look: Look) -> None:
        """Apply the look's paint to all bodies."""
        self._paint(self._ground, look.ground)
        for gate, paint in zip(self._gates, cycle(look.gates), strict=False):
            self._paint(gate, paint)
        for obstacle in self._obstacles:
            self._paint(obstacle, look.obstacles)

    def _paint(self, body: _Body, paint: Paint) -> None:
        """Apply paint to a body."""
        for link in body.links:
            bullet.changeVisualShape(
                body.number,
                link,
                textureUniqueId=self._textures[paint.texture],
                rgbaColor=(*paint.colour, 1.0),
                **self._at,
            )


def _view(position: np.ndarray, axes: np.ndarray) -> list[float]:
    """Return OpenGL's view matrix by columns; its camera frame has y up and the view along -z."""
    turn = np.diag([1.0, -1.0, -1.0]) @ axes.T
    view = np.eye(4)
    view[:3, :3] = turn
    view[:3, 3] = -turn @ position
    return view.T.ravel().tolist()


def _projection(camera: Camera) -> list[float]:
    """Return OpenGL's projection matrix by columns.

    TinyRenderer samples pixel (i, j) at u = j, v = i + 1. The matrix shifts the picture by half a
    pixel each way, so that a sample lies in the pixel's centre.
    """
    matrix = np.zeros((4, 4))
    matrix[0, 0] = 2.0 * camera.fx / camera.width
    matrix[0, 2] = 1.0 / camera.width
    matrix[1, 1] = 2.0 * camera.fy / camera.height
    matrix[1, 2] = 1.0 / camera.height
    matrix[2, 2] = -(FAR + NEAR) / (FAR - NEAR)
    matrix[2, 3] = -2.0 * FAR * NEAR / (FAR - NEAR)
    matrix[3, 2] = -1.0
    return matrix.T.ravel().tolist()
