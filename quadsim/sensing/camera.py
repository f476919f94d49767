"""A pinhole camera on the vehicle: which point of the world is seen at which place of the picture.

Camera frame: x to the right of the picture, y down, z along the optical axis. Level, the axis is
the body's x axis; `tilt_deg` turns it up. A point (x, y, z) of that frame is seen at

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
from msgspec import Meta

from quadsim.course import Gate
from quadsim.files.data_files import locate, names, read_text
from quadsim.files.strict_yaml import load, unit
from quadsim.rotation import Quaternion, Vec3, to_world

CAMERAS = Path(__file__).parent / "cameras"
BODY_AXES = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

Pixels = Annotated[int, unit("px", ge=8, le=8192)]
Focal = Annotated[float, unit("px", gt=0, le=1e5)]
Metre = Annotated[float, unit("m", ge=-2, le=2)]


@dataclass(frozen=True)
class Camera:
    """The numbers of a camera file."""

    width: Pixels
    height: Pixels
    fx: Focal
    fy: Focal
    tilt_deg: Annotated[float, unit("deg", ge=-90, le=90)] = 0.0  # of the optical axis, up
    rate: Annotated[float, unit("Hz", gt=0, le=1000)] = 30.0  # pictures a second
    position: tuple[Metre, Metre, Metre] = (0.0, 0.0, 0.0)  # in the body frame
    source: Annotated[str, Meta(max_length=200)] = ""

    @cached_property
    def axes(self) -> np.ndarray:
        """Body from camera. Columns: right, down and optical axis in the body frame.  (3, 3)"""
        c, s = cos(radians(self.tilt_deg)), sin(radians(self.tilt_deg))
        return np.array([[0.0, s, c], [-1.0, 0.0, 0.0], [0.0, -c, s]])

    def pose(self, p: Vec3, q: Quaternion) -> tuple[np.ndarray, np.ndarray]:
        """Where the camera of a vehicle at p [m] with attitude q (wxyz) is: position (3,), world
        from camera (3, 3)."""
        body = np.array([to_world(q, axis) for axis in BODY_AXES]).T  # world from body
        return np.asarray(p, float) + body @ np.asarray(self.position), body @ self.axes

    def project(self, points: np.ndarray, p: Vec3, q: Quaternion) -> tuple[np.ndarray, np.ndarray]:
        """Points of the world (n, 3) [m] as pixels (u, v) (n, 2), and their depth along the optical
        axis (n,) [m].

        nan in place of pixels where the depth is not positive: such a point is not in front of the
        camera.
        """
        position, axes = self.pose(p, q)
        return self.to_pixels((points - position) @ axes)

    def to_pixels(self, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same for points of the camera frame.  (n, 3)"""
        depth = local[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = local[:, :2] * (self.fx, self.fy) / depth[:, None] + (
                self.width / 2,
                self.height / 2,
            )
        pixels[depth <= 0.0] = np.nan
        return pixels, depth

    def in_picture(self, pixels: np.ndarray) -> np.ndarray:
        """Which pixels (n, 2) lie within the picture; those that are nan do not.  (n,) bool"""
        return np.all((pixels >= 0.0) & (pixels < (self.width, self.height)), axis=1)

    def gate_corners(
        self, gates: Sequence[Gate], p: Vec3, q: Quaternion
    ) -> tuple[np.ndarray, np.ndarray]:
        """The corners of the gates' openings, in the order of `Gate.corners`, as `project` gives
        points.

        Returns: pixels (n_gates, 4, 2), depth (n_gates, 4) [m].
        """
        points = np.array([gate.corners() for gate in gates]).reshape(-1, 3)
        pixels, depth = self.project(points, p, q)
        return pixels.reshape(-1, 4, 2), depth.reshape(-1, 4)


def camera_names() -> tuple[str, ...]:
    """The cameras that come with the project."""
    return names(CAMERAS)


def load_camera(name_or_path: str | Path) -> Camera:
    """A camera by name ("aigp") or path ("mine.yaml"). Raises FileError."""
    path = locate(name_or_path, CAMERAS, "camera", listed=False)
    return parse_camera(read_text(path), str(path))


def parse_camera(text: str, file: str) -> Camera:
    """A camera from its text; `file` is shown in errors. Raises FileError."""
    return load(text, file, Camera)
