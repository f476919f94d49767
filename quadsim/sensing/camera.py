"""A pinhole camera on the vehicle: from points of the world to pixels.

Camera frame: x to the right of the picture, y down, z along the optical axis. Level, the axis is
the body's x axis; `tilt_deg` turns it up. A point (x, y, z) of that frame projects to

    u = f_x x / z + width / 2,    v = f_y y / z + height / 2        [px]

(Hartley and Zisserman 2004, eq. 6.1), u from the left edge of the picture, v from its top: pixel
(row i, column j) covers j <= u < j + 1, i <= v < i + 1. No distortion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import cos, radians, sin
from pathlib import Path
from typing import Annotated

import numpy as np

from quadsim.course import Gate
from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import load, setting, unit
from quadsim.rotation import Quaternion, Vec3, to_world

CAMERAS = Path(__file__).parent / "cameras"
BODY_AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

Pixels = Annotated[int, unit("px", ge=8, le=8192)]
Focal = Annotated[float, unit("px", gt=0, le=1e5)]
Metre = Annotated[float, unit("m", ge=-2, le=2)]


@dataclass(frozen=True)
class Camera:
    """The numbers of a camera file."""

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
        """The rotation body from camera, with the columns right, down and optical axis.  (3, 3)"""
        c = cos(radians(self.tilt_deg))
        s = sin(radians(self.tilt_deg))
        return np.array([[0.0, s, c], [-1.0, 0.0, 0.0], [0.0, -c, s]])

    def pose(self, p: Vec3, q: Quaternion) -> tuple[np.ndarray, np.ndarray]:
        """Return the camera's pose, given the pose of its vehicle.

        Args:
            p: position of the vehicle [m].
            q: attitude of the vehicle, wxyz.

        Returns:
            The position [m] (3,), and the rotation world from camera (3, 3).
        """
        body = np.array([to_world(q, axis) for axis in BODY_AXES]).T  # world from body
        return np.asarray(p, float) + body @ np.asarray(self.position), body @ self.axes

    def project(self, points: np.ndarray, p: Vec3, q: Quaternion) -> tuple[np.ndarray, np.ndarray]:
        """Project points of the world to pixels, and return their depth.

        Args:
            points: (n, 3) [m].
            p: position of the vehicle [m].
            q: attitude of the vehicle, wxyz.

        Returns:
            Pixels (u, v) (n, 2), nan if the depth is not positive, as such a point is not in
            front of the camera; and the depth along the optical axis [m] (n,).
        """
        position, axes = self.pose(p, q)
        return self.to_pixels((points - position) @ axes)

    def to_pixels(self, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return pixels and depth as `project` does, for points of the camera frame.

        Args:
            local: (n, 3) [m].
        """
        depth = local[:, 2]
        focal = (self.fx, self.fy)
        centre = (self.width / 2, self.height / 2)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = local[:, :2] * focal / depth[:, None] + centre
        pixels[depth <= 0.0] = np.nan
        return pixels, depth

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


def camera_names() -> tuple[str, ...]:
    """Return the names of the cameras that come with the project."""
    return names(CAMERAS)


def load_camera(name_or_path: str | Path) -> Camera:
    """Return a camera by name ("aigp") or path ("mine.yaml"). Raises FileError."""
    path = locate(name_or_path, CAMERAS, "camera", listed=False)
    return parse_camera(read_text(path), str(path))


def parse_camera(text: str, file: str) -> Camera:
    """Return the camera of a YAML text; `file` is shown in errors. Raises FileError."""
    return load(text, file, Camera)
