"""Renders a course as a camera sees it: colour, depth, and the gate in each pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import cycle
from typing import NamedTuple

import numpy as np

from quadsim.course import Course
from quadsim.course.frames import frames
from quadsim.render.faces import (
    Banner,
    Face,
    banner_faces,
    gate_faces,
    ground_faces,
    obstacle_faces,
    vehicle_faces,
)
from quadsim.render.lens import Distortion, Pinhole
from quadsim.render.look import FLAT, Light, Look, Paint, textures
from quadsim.render.raster import (
    NONE,
    TEXELS,
    Drawn,
    Faces,
    Film,
    draw,
    pyramid,
    rows_of_faces,
    work_space,
)
from quadsim.rotation import Quaternion, Vec3, matrix
from quadsim.sensing.camera import Camera, LensCamera

# Numbers in the segmentation; gates have their numbers from 1.
SKY = 0
OBSTACLE = 254
GROUND_ID = 255
LAST_GATE = OBSTACLE - 1
# Offsets within a pixel of several passes, to the right and down [px]: each row and each column of
# a grid of four by four has one.
OFFSETS = np.array([[-0.125, -0.375], [0.375, -0.125], [-0.375, 0.125], [0.125, 0.375]])
# Colours come out as they are painted, without noise.
PLAIN_FILM = Film(gain=1.0, read=0.0, shot=0.0, grain=np.zeros((3, 1, 1), np.float32), shift=(0, 0))


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of the camera."""

    # (height, width, 3) uint8
    rgb: np.ndarray
    # along the optical axis [m]; inf: sky  (height, width) float32
    depth: np.ndarray
    # SKY, the gate's number from 1, OBSTACLE, GROUND_ID  (height, width) uint8
    segmentation: np.ndarray


class Views(NamedTuple):
    """The poses of the camera for each pass and row of the picture."""

    # position [m]  (passes, height, 3)
    eyes: np.ndarray
    # rotation world from camera  (passes, height, 3, 3)
    axes: np.ndarray


class Painted(NamedTuple):
    """A face with its paint and its number in the segmentation."""

    face: Face
    paint: Paint
    number: int


class Scene:
    """The gates, the obstacles and the ground of a course, with banners and vehicles.

    Args:
        course: gates and obstacles.
        camera: the camera that takes the pictures.
        radius: radius of a drawn vehicle [m], which the segmentation counts as an obstacle. None:
            no vehicle is drawn.
        banners: sheets with the gates' paint, which the segmentation counts as obstacles.

    Raises:
        ValueError: the course has more gates than 8 bits can number.
    """

    def __init__(
        self,
        course: Course,
        camera: Camera,
        radius: float | None = None,
        banners: Sequence[Banner] = (),
    ):
        self.course = course
        # each once, however often a lap leads through it
        gates = frames(course.gates)
        if len(gates) > LAST_GATE:
            raise ValueError(f"{course.name}: expected at most {LAST_GATE} gates, got {len(gates)}")
        self._camera = camera
        self._distortion = None
        if isinstance(camera, LensCamera) and camera.bends:
            self._distortion = Distortion(camera)
        self._pinhole = self._distortion.pinhole if self._distortion else _pinhole(camera)
        self._gates = gates
        self._banners = tuple(banners)
        self._vehicle = () if radius is None else tuple(vehicle_faces(radius))
        self._places: tuple[tuple[Vec3, Quaternion], ...] = ()
        # the look of the faces below; None: they have to be made
        self._look: Look | None = None
        self._faces = _arrays([], None)

    @property
    def rows(self) -> int:
        """The number of rows of `Views`, larger than the picture's if the lens is distorted."""
        return self._pinhole.shape[0]

    def place(self, p: Vec3, q: Quaternion) -> None:
        """Move the drawn vehicle.

        Args:
            p: position [m].
            q: attitude, wxyz.
        """
        self.place_all([(p, q)])

    def place_all(self, poses: Sequence[tuple[Vec3, Quaternion]]) -> None:
        """Draw vehicles at these poses only, each a position [m] and an attitude (wxyz)."""
        self._places = tuple(poses)
        self._look = None

    def shoot(self, p: Vec3, q: Quaternion, look: Look) -> Picture:
        """Return the picture of a vehicle's camera, without the vehicle itself.

        Args:
            p: position of the vehicle [m].
            q: attitude of the vehicle, wxyz.
            look: paint, light and sky.
        """
        position, axes = self._camera.pose(p, q)
        views = Views(np.tile(position, (1, self.rows, 1)), np.tile(axes, (1, self.rows, 1, 1)))
        return self.expose(views, look)

    def expose(self, views: Views, look: Look, film: Film = PLAIN_FILM) -> Picture:
        """Return the mean of several passes, as an open shutter records it.

        Depth and segmentation belong to the first pass. A single pass samples the middle of each
        pixel; several passes sample it at OFFSETS in turn.

        Args:
            views: poses of the camera, for each row of the pinhole's picture if the lens is
                distorted.
            look: paint, light and sky.
            film: brightness and noise.
        """
        drawn = self._draw(views, look, film)
        with np.errstate(divide="ignore"):
            depth = np.float32(1.0) / drawn.inverse_depth
        numbers = np.append(self._faces.ids, np.uint8(SKY))
        seen = numbers[drawn.seen]
        if self._distortion:
            depth = self._distortion.nearest(depth)
            seen = self._distortion.nearest(seen)
        return Picture(self._bent(drawn.rgb), depth, seen)

    def colours(self, views: Views, look: Look, film: Film = PLAIN_FILM) -> np.ndarray:
        """Return only the colours of `expose`.  (height, width, 3) uint8"""
        return self._bent(self._draw(views, look, film).rgb)

    def _bent(self, rgb: np.ndarray) -> np.ndarray:
        """Return the colours of the picture from `Drawn.rgb`.  (height, width, 3) uint8"""
        if self._distortion:
            return self._distortion.colours(rgb)
        return rgb.reshape(*self._pinhole.shape, 3)

    def _draw(self, views: Views, look: Look, film: Film) -> Drawn:
        """Return the arrays of the pinhole's picture."""
        if look is not self._look:
            self._faces = _arrays(self._painted(look), look.light)
            self._look = look
        shape, lens = self._pinhole
        passes = len(views.eyes)
        offsets = np.resize(OFFSETS, (passes, 2)) if passes > 1 else np.zeros((1, 2))
        eyes = np.ascontiguousarray(views.eyes, float)
        axes = np.ascontiguousarray(views.axes, float)
        faces = self._faces
        rows = np.empty((len(faces.ids), 2), np.int64)
        rows_of_faces(eyes, axes, faces, lens, shape, rows)
        height, width = shape
        drawn = Drawn(
            np.empty((height, 3 * width), np.uint8),
            np.empty(shape, np.float32),
            np.empty(shape, np.int16),
        )
        row = work_space(width, len(faces.ids))
        draw(eyes, axes, offsets, rows, faces, _textures(), look.sky, lens, film, row, drawn)
        return drawn

    def _painted(self, look: Look) -> list[Painted]:
        """Return all faces of the scene with their paint."""
        found = [Painted(face, look.ground, GROUND_ID) for face in ground_faces()]
        for gate, paint in zip(self._gates, cycle(look.gates), strict=False):
            number = self.course.gates.index(gate) + 1
            found += [Painted(face, paint, number) for face in gate_faces(gate)]
        for obstacle in self.course.obstacles:
            found += [Painted(face, look.obstacles, OBSTACLE) for face in obstacle_faces(obstacle)]
        for banner, paint in zip(self._banners, cycle(look.gates), strict=False):
            found += [Painted(face, paint, OBSTACLE) for face in banner_faces(banner)]
        for p, q in self._places:
            turn = matrix(q)
            for colour, face in self._vehicle:
                moved = face._replace(
                    origin=p + turn @ face.origin, a=turn @ face.a, b=turn @ face.b
                )
                found.append(Painted(moved, Paint(FLAT, colour), OBSTACLE))
        return found


def _pinhole(camera: Camera) -> Pinhole:
    """Return the picture's size and lens for a camera without distortion."""
    lens = (float(camera.fx), float(camera.fy), camera.width / 2, camera.height / 2)
    return Pinhole((camera.height, camera.width), lens)


@cache
def _textures() -> np.ndarray:
    """Return the levels of detail of all textures.  (textures, n) int32"""
    return np.array([pyramid(texture) for texture in textures()])


def _arrays(painted: Sequence[Painted], light: Light | None) -> Faces:
    """Return faces as arrays, with their colours under a light."""
    n = len(painted)
    a = np.array([one.face.a for one in painted]).reshape(n, 3)
    b = np.array([one.face.b for one in painted]).reshape(n, 3)
    kinds = np.array([one.face.kind for one in painted], np.int64)
    two_sided = np.array([one.face.two_sided for one in painted], bool)
    normal = np.cross(a, b).reshape(n, 3)
    numbers = [one.paint.texture for one in painted]
    tile = np.array([one.face.tile for one in painted])
    lengths = np.column_stack([np.linalg.norm(a, axis=1), np.linalg.norm(b, axis=1)])
    repeats = lengths / tile[:, None]
    colours = np.array([one.paint.colour for one in painted]).reshape(n, 3)
    return Faces(
        origin=np.array([one.face.origin for one in painted], float).reshape(n, 3),
        a=a,
        b=b,
        normal=normal,
        kind=kinds,
        hole=np.array([one.face.hole for one in painted], float).reshape(n, 2),
        two_sided=two_sided,
        ids=np.array([one.number for one in painted], np.uint8),
        texture=np.array([NONE if k == FLAT else k for k in numbers], np.int64),
        repeats=repeats,
        texels=TEXELS * np.sqrt(repeats.prod(axis=1) * np.linalg.norm(normal, axis=1)),
        tint=(colours * _shades(normal, two_sided, light)).astype(np.float32),
    )


def _shades(normals: np.ndarray, two_sided: np.ndarray, light: Light | None) -> np.ndarray:
    """Return the light that faces reflect, by Lambert's law.  (n, 3)"""
    if light is None:
        return np.ones((len(normals), 3))
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    towards = np.array(light.towards) / np.linalg.norm(light.towards)
    lit = normals @ towards
    lit = np.where(two_sided, abs(lit), np.maximum(lit, 0.0))
    return (light.ambient + light.diffuse * lit)[:, None] * np.array(light.colour)
