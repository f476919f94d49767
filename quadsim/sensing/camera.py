"""The projection of points of the world to pixels of a camera on the vehicle.

Camera frame: x to the right of the picture, y down, z along the optical axis. Without tilt the
optical axis is the body's x axis; `tilt_deg` turns it up. A point (x, y, z) of the camera frame
projects to

    u = f_x x / z + width / 2,    v = f_y y / z + height / 2        [px]

(Hartley and Zisserman 2004, eq. 6.1), u from the left edge of the picture, v from its top: pixel
(row i, column j) covers j <= u < j + 1, i <= v < i + 1.

The cameras that sensors use are such pinhole cameras, because flight software rectifies its
pictures. A camera that only renders pictures may also have a lens with radial distortion (Brown
1966, as in OpenCV): with the ray (x, y) / z at the distance r from the optical axis,

    (x, y) / z  <-  (1 + k1 r^2 + k2 r^4) (x, y) / z
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import cos, radians, sin
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from quadsim.course import Gate
from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import FileError, load, setting, unit
from quadsim.rotation import Quaternion, Vec3, exp, matrix, to_world

CAMERAS = Path(__file__).parent / "cameras"
BODY_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

Pixels = Annotated[int, unit("px", ge=8, le=8192)]
Focal = Annotated[float, unit("px", gt=0, le=1e5)]
Metre = Annotated[float, unit("m", ge=-2, le=2)]
Distortion = Annotated[float, unit("1", ge=-10, le=10)]

# [m] least depth along the optical axis; sensors and estimator see nothing that is nearer
NEAREST = 0.1

# Steps of Newton's method from a distorted ray to the ray outside of the lens
NEWTON_STEPS = 40
# Longest distance of a ray from the axis for which a lens is checked: 79 degrees
MOST_DISTANCE = 5.0
# Derivative of the distorted distance from the axis, below which a lens is refused
LEAST_SLOPE = 0.05


class CameraPose(NamedTuple):
    """A pose of a camera."""

    # [m]  (3,)
    eye: np.ndarray
    # rotation world from camera  (3, 3)
    axes: np.ndarray

    def local(self, points: np.ndarray) -> np.ndarray:
        """Return points of the world (n, 3) in the frame of the camera [m]."""
        return (points - self.eye) @ self.axes


class BodyPose(NamedTuple):
    """A pose of the vehicle that carries a camera."""

    # [m]  (3,)
    position: np.ndarray
    # rotation world from body  (3, 3)
    body: np.ndarray

    def corrected(self, error: np.ndarray) -> BodyPose:
        """Return the pose after a correction by an error.

        Args:
            error: error of the position [m], then rotation error in the body frame [rad]  (6,).
        """
        turned = self.body @ matrix(exp(error[3:].tolist()))
        return BodyPose(self.position + error[:3], turned)


class Seen(NamedTuple):
    """Projected points, and their Jacobian with respect to the error of the vehicle's pose."""

    # [px]  (n, 2)
    pixels: np.ndarray
    # along the optical axis [m]  (n,)
    depth: np.ndarray
    # [px/m] for the position, [px/rad] for the turn in the body frame  (n, 2, 6)
    moves: np.ndarray


@dataclass(frozen=True)
class Camera:
    """A pinhole camera, with the keys of a camera file."""

    width: Annotated[Pixels, setting("width of a picture [px]")]
    height: Annotated[Pixels, setting("height of a picture [px]")]
    fx: Annotated[Focal, setting("focal length to the right [px]")]
    fy: Annotated[Focal, setting("focal length down [px]")]
    tilt_deg: Annotated[
        float, setting("tilt of the optical axis, up [deg]", unit="deg", ge=-90, le=90)
    ] = 0.0
    rate: Annotated[float, setting("pictures a second [Hz]", unit="Hz", gt=0, le=1000)] = 30.0
    position: Annotated[tuple[Metre, Metre, Metre], setting("position in the body frame [m]")] = (
        0.0,
        0.0,
        0.0,
    )
    source: Annotated[str, setting("origin of the numbers", max_length=200)] = ""

    @cached_property
    def axes(self) -> np.ndarray:
        """The rotation from camera to body; columns are right, down and optical axis.  (3, 3)"""
        c = cos(radians(self.tilt_deg))
        s = sin(radians(self.tilt_deg))
        return np.array([[0.0, s, c], [-1.0, 0.0, 0.0], [0.0, -c, s]])

    def pose(self, p: Vec3, q: Quaternion) -> CameraPose:
        """Return the camera's pose, given the pose of its vehicle.

        Args:
            p: position of the vehicle [m].
            q: attitude of the vehicle, wxyz.
        """
        body = np.array([to_world(q, axis) for axis in BODY_AXES]).T  # world from body
        return self.carried(BodyPose(np.asarray(p, float), body))

    def carried(self, pose: BodyPose) -> CameraPose:
        """Return the camera's pose in the world, given the pose of its vehicle."""
        position = pose.position + pose.body @ np.asarray(self.position)
        return CameraPose(position, pose.body @ self.axes)

    def project(self, points: np.ndarray, p: Vec3, q: Quaternion) -> tuple[np.ndarray, np.ndarray]:
        """Project points of the world to pixels, and return their depth.

        Args:
            points: points in the world [m]  (n, 3).
            p: position of the vehicle [m].
            q: attitude of the vehicle, wxyz.

        Returns:
            Pixels (u, v)  (n, 2), nan for points that are not in front of the camera; and the depth
            along the optical axis [m]  (n,).
        """
        return self.to_pixels(self.pose(p, q).local(points))

    def to_pixels(self, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels and depth as `project` does, for points of the camera frame.

        Args:
            local: points in the camera frame [m]  (n, 3).
        """
        depth = local[:, 2]
        focal = (self.fx, self.fy)
        centre = (self.width / 2, self.height / 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = local[:, :2] * focal / depth[:, None] + centre
        pixels[depth <= 0.0] = np.nan
        return pixels, depth

    def seen(self, points: np.ndarray, pose: BodyPose) -> Seen:
        """Return the pixels of points, and their Jacobian with respect to the error of a pose.

        A point that is nearer than NEAREST, or behind the camera, is projected as if its depth were
        NEAREST.

        Args:
            points: points in the world [m]  (n, 3).
            pose: pose of the vehicle.
        """
        body = (points - pose.position) @ pose.body
        local = (body - np.asarray(self.position)) @ self.axes
        depth = local[:, 2].copy()
        local[:, 2] = np.maximum(depth, NEAREST)
        pixels, _ = Camera.to_pixels(self, local)

        # Pixels move with the point in the frame of the camera, and so in the frame of the body.
        x, y, z = local.T
        by_local = np.zeros((len(points), 2, 3))
        by_local[:, 0, 0] = self.fx / z
        by_local[:, 1, 1] = self.fy / z
        by_local[:, 0, 2] = -self.fx * x / z**2
        by_local[:, 1, 2] = -self.fy * y / z**2
        by_body = by_local @ self.axes.T
        # The error dtheta turns a point b of the body frame by -dtheta, to b + b x dtheta: a row a
        # of `by_body` gives a x b.
        by_turn = np.cross(by_body, body[:, None])
        return Seen(pixels, depth, np.concatenate([-by_body @ pose.body.T, by_turn], axis=2))

    def in_picture(self, pixels: np.ndarray) -> np.ndarray:
        """Return which pixels (n, 2) lie within the picture; nan counts as outside.  (n,) bool"""
        return np.all((pixels >= 0.0) & (pixels < (self.width, self.height)), axis=1)

    def gate_corners(
        self, gates: Sequence[Gate], p: Vec3, q: Quaternion
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels and depth of the corners of gates' openings, as `project` does.

        Returns:
            Pixels (gates, 4, 2) and depth [m] (gates, 4), in the order of `Gate.corners`.
        """
        points = np.array([gate.corners() for gate in gates]).reshape(-1, 3)
        pixels, depth = self.project(points, p, q)
        return pixels.reshape(-1, 4, 2), depth.reshape(-1, 4)


@dataclass(frozen=True)
class LensCamera(Camera):
    """A camera for rendered pictures, whose lens may distort straight lines."""

    k1: Annotated[Distortion, setting("radial distortion, of the square of the distance")] = 0.0
    k2: Annotated[Distortion, setting("radial distortion, of the fourth power")] = 0.0

    @property
    def bends(self) -> bool:
        """Whether the lens has distortion."""
        return self.k1 != 0.0 or self.k2 != 0.0

    def to_pixels(self, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels and depth as `project` does, for points of the camera frame.

        A point beyond the edge of the lens has no pixel: the distorted distance from the axis no
        longer grows there, so the formula would give a pixel inside the picture.
        """
        if not self.bends:
            return super().to_pixels(local)
        depth = local[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            ray = local[:, :2] / depth[:, None]
        distance = np.linalg.norm(ray, axis=1)
        squared = (distance**2)[:, None]
        bent = (1.0 + squared * (self.k1 + self.k2 * squared)) * ray
        pixels = bent * (self.fx, self.fy) + (self.width / 2, self.height / 2)
        pixels[(depth <= 0.0) | (distance > self._edge)] = np.nan
        return pixels, depth

    def rays(self, pixels: np.ndarray) -> np.ndarray:
        """Return the rays (x, y) / z that reach pixels, the inverse of `to_pixels`.

        Args:
            pixels: pixels within the picture [px]  (..., 2).
        """
        bent = (pixels - (self.width / 2, self.height / 2)) / (self.fx, self.fy)
        reached = np.linalg.norm(bent, axis=-1)
        distance = np.minimum(reached, self._edge)
        least = np.zeros_like(reached)
        most = np.full_like(reached, self._edge)
        for _ in range(NEWTON_STEPS):
            error = self._bent(distance) - reached
            least = np.where(error < 0.0, distance, least)
            most = np.where(error > 0.0, distance, most)
            newton = distance - error / self._slope(distance)
            # With strong distortion Newton's steps leave what is known of the distance: halve that.
            is_within = (least <= newton) & (newton <= most)
            distance = np.where(is_within, newton, 0.5 * (least + most))
        scale = np.divide(distance, reached, out=np.ones_like(distance), where=reached > 0.0)
        return bent * scale[..., None]

    def problem(self) -> str:
        """Return why the distortion is not valid, "" if it is.

        The distorted distance from the axis has to grow up to the corners of the picture.
        """
        corner = np.hypot(self.width / 2 / self.fx, self.height / 2 / self.fy)
        if self._bent(self._edge) >= corner:
            return ""
        return (
            f"expected a lens through which rays reach the picture's corners, {corner:.2f} from "
            f"the axis, got k1 {self.k1:g} and k2 {self.k2:g}, with rays up to "
            f"{self._bent(self._edge):.2f}; bring k1 and k2 nearer to 0 or lengthen fx and fy"
        )

    @cached_property
    def _edge(self) -> float:
        """The distance from the axis up to which the distorted distance grows."""
        distances = np.linspace(0.0, MOST_DISTANCE, 2001)
        slopes = self._slope(distances)
        falls = np.flatnonzero(slopes < LEAST_SLOPE)
        return float(distances[falls[0] - 1]) if len(falls) else MOST_DISTANCE

    def _bent(self, r: np.ndarray | float) -> np.ndarray | float:
        return r * (1.0 + r**2 * (self.k1 + self.k2 * r**2))

    def _slope(self, r: np.ndarray) -> np.ndarray:
        return 1.0 + r**2 * (3.0 * self.k1 + 5.0 * self.k2 * r**2)


def camera_names() -> tuple[str, ...]:
    """Return the names of the cameras that come with the project."""
    return names(CAMERAS)


def load_camera(name_or_path: str | Path) -> LensCamera:
    """Return a camera by name ("aigp") or path ("mine.yaml"). Raises FileError."""
    path = locate(name_or_path, CAMERAS, "camera", listed=False)
    return parse_camera(read_text(path), str(path))


def parse_camera(text: str, file: str) -> LensCamera:
    """Return the camera of a YAML text; `file` is shown in errors. Raises FileError."""
    camera = load(text, file, LensCamera)
    if problem := camera.problem():
        raise FileError(f"{file}: k1: {problem}")
    return camera
