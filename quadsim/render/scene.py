"""A course as PyBullet's TinyRenderer draws it: colour, depth, and which gate stands in each
pixel."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from quadsim.course import Course, Gate
from quadsim.course.obstacles import Cylinder, Obstacle
from quadsim.physics.world import bullet  # its only importer
from quadsim.render.look import TEXTURES, Look, textures
from quadsim.rotation import Quaternion, Vec3
from quadsim.sensing.camera import Camera

NEAR, FAR = 0.05, 400.0  # planes between which something is drawn [m]
GROUND = 600.0  # half the ground's edge [m]
TILE = 8.0  # one picture of the ground's texture covers [m]
SKY, OBSTACLE, GROUND_ID = 0, 254, 255  # in the segmentation; a gate has its number, from 1
LAST_GATE = OBSTACLE - 1


@dataclass(frozen=True, eq=False)
class Picture:
    """What the camera sees."""

    rgb: np.ndarray  # (height, width, 3) uint8
    depth: np.ndarray  # (height, width) float32, along the optical axis [m]; inf: sky
    # (height, width) uint8: SKY, the gate's number from 1, OBSTACLE, GROUND_ID
    segmentation: np.ndarray


class Scene:
    """The gates, the obstacles and the ground of a course, in a PyBullet client of its own. close()
    frees it."""

    def __init__(self, course: Course, camera: Camera):
        """Raises ValueError for more gates than a picture of 8 bits tells apart."""
        # each once, however often a lap leads through it
        gates = tuple(dict.fromkeys(course.gates))
        if len(gates) > LAST_GATE:
            raise ValueError(f"{course.name}: expected at most {LAST_GATE} gates, got {len(gates)}")
        self._camera = camera
        self._client = bullet.connect(bullet.DIRECT)
        self._at: dict[str, int] = {"physicsClientId": self._client}
        bodies = [
            self._add_ground(),
            *map(self._add_gate, gates),
            *map(self._add_obstacle, course.obstacles),
        ]
        self._count = len(gates), len(course.obstacles)
        self._bodies = [
            (body, {s[1] for s in bullet.getVisualShapeData(body, **self._at)}) for body in bodies
        ]
        numbers = (course.gates.index(gate) + 1 for gate in gates)
        ids = [GROUND_ID, *numbers, *[OBSTACLE] * len(course.obstacles), SKY]
        self._ids = np.array(ids, np.uint8)  # of the bodies 0, 1, ..., and of -1, nothing
        self._textures = self._load_textures()
        self._rays = _rays(camera)

    def shoot(self, p: Vec3, q: Quaternion, look: Look) -> Picture:
        """The picture of a vehicle's camera: the vehicle at p [m] with the attitude q (wxyz).
        Itself it is not seen."""
        self._dress(look)
        position, axes = self._camera.pose(p, q)
        answer = bullet.getCameraImage(
            self._camera.width,
            self._camera.height,
            _view(position, axes),
            _projection(self._camera),
            lightDirection=look.light,
            lightColor=look.light_colour,
            lightAmbientCoeff=look.ambient,
            lightDiffuseCoeff=look.diffuse,
            lightSpecularCoeff=look.specular,
            shadow=0,  # TinyRenderer's are too coarse for gates on wide ground
            renderer=bullet.ER_TINY_RENDERER,
            **self._at,
        )
        shape = (self._camera.height, self._camera.width)
        rgb = np.reshape(answer[2], (*shape, 4))[..., :3].astype(np.uint8)
        segmentation = self._ids[np.reshape(answer[4], shape)]
        depth = np.float32(FAR * NEAR) / (
            np.float32(FAR) - np.float32(FAR - NEAR) * np.reshape(answer[3], shape)
        )
        sky = segmentation == SKY
        depth[sky] = np.inf
        rgb[sky] = look.sky(self._rays[sky] @ axes.T.astype(np.float32))
        return Picture(rgb, depth, segmentation)

    def close(self) -> None:
        if bullet.isConnected(**self._at):
            bullet.disconnect(**self._at)

    def _add_ground(self) -> int:
        edge, tiles = GROUND, 2 * GROUND / TILE
        corners = [[-edge, -edge, 0.0], [edge, -edge, 0.0], [edge, edge, 0.0], [-edge, edge, 0.0]]
        square = bullet.createVisualShape(
            bullet.GEOM_MESH,
            vertices=corners,
            indices=[0, 1, 2, 0, 2, 3],
            uvs=[[0, 0], [tiles, 0], [tiles, tiles], [0, tiles]],
            normals=[[0, 0, 1]] * 4,
            **self._at,
        )
        return bullet.createMultiBody(0.0, -1, square, **self._at)

    def _add_gate(self, gate: Gate) -> int:
        centres, halves = map(list, zip(*gate.bars, strict=True))
        frame = bullet.createVisualShapeArray(
            shapeTypes=[bullet.GEOM_BOX] * 4,
            halfExtents=halves,
            visualFramePositions=centres,
            **self._at,
        )
        attitude = bullet.getQuaternionFromEuler([gate.roll, gate.pitch, gate.yaw], **self._at)
        return bullet.createMultiBody(
            0.0, -1, frame, basePosition=gate.position, baseOrientation=attitude, **self._at
        )

    def _add_obstacle(self, obstacle: Obstacle) -> int:
        if isinstance(obstacle, Cylinder):
            kind, size, yaw = (
                bullet.GEOM_CYLINDER,
                {"radius": obstacle.radius, "length": obstacle.height},
                0.0,
            )
        else:
            kind, size, yaw = bullet.GEOM_BOX, {"halfExtents": obstacle.half}, obstacle.yaw
        shape = bullet.createVisualShape(kind, **size, **self._at)
        attitude = bullet.getQuaternionFromEuler([0.0, 0.0, yaw], **self._at)
        return bullet.createMultiBody(
            0.0, -1, shape, basePosition=obstacle.centre, baseOrientation=attitude, **self._at
        )

    def _load_textures(self) -> list[int]:
        """Each once, as PyBullet reads a texture from a file, and never drops it; those in use do
        not change."""
        with tempfile.TemporaryDirectory() as folder:
            paths = [Path(folder) / f"{i}.png" for i in range(TEXTURES)]
            for path, pixels in zip(paths, textures(), strict=True):
                Image.fromarray(pixels).save(path)
            return [bullet.loadTexture(str(path), **self._at) for path in paths]

    def _dress(self, look: Look) -> None:
        """Put the look's paint on."""
        gates, obstacles = self._count
        paints = [
            look.ground,
            *(look.gates[k % len(look.gates)] for k in range(gates)),
            *[look.obstacles] * obstacles,
        ]
        for (body, links), (texture, colour) in zip(self._bodies, paints, strict=True):
            for link in links:
                worn = {"textureUniqueId": self._textures[texture], "rgbaColor": (*colour, 1.0)}
                bullet.changeVisualShape(body, link, **worn, **self._at)


def _rays(camera: Camera) -> np.ndarray:
    """Directions through the centres of the pixels, of length 1, in the camera frame.  (height,
    width, 3)"""
    u, v = np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5
    x, y = np.meshgrid((u - camera.width / 2) / camera.fx, (v - camera.height / 2) / camera.fy)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1)
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).astype(np.float32)


def _view(position: np.ndarray, axes: np.ndarray) -> list[float]:
    """OpenGL's view matrix, by columns: its camera frame has y up and looks along -z."""
    turn = np.diag([1.0, -1.0, -1.0]) @ axes.T
    view = np.eye(4)
    view[:3, :3], view[:3, 3] = turn, -turn @ position
    return view.T.ravel().tolist()


def _projection(camera: Camera) -> list[float]:
    """OpenGL's projection matrix, by columns.

    TinyRenderer samples pixel (i, j) at u = j, v = i + 1; half a pixel more each way and it does at
    the pixel's centre.
    """
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[0, 2] = 2.0 * camera.fx / camera.width, 1.0 / camera.width
    matrix[1, 1], matrix[1, 2] = 2.0 * camera.fy / camera.height, 1.0 / camera.height
    matrix[2, 2], matrix[2, 3] = -(FAR + NEAR) / (FAR - NEAR), -2.0 * FAR * NEAR / (FAR - NEAR)
    matrix[3, 2] = -1.0
    return matrix.T.ravel().tolist()
