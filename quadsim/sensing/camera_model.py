"""The gate camera's numbers: a pinhole camera, and how well the corners of gates are found in its
pictures.

The sensor and the estimator share them; the picture's geometry is that of quadsim.sensing.camera.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from quadsim.files.strict_yaml import unit
from quadsim.sensing.camera import Camera
from quadsim.sensing.config import Latency, Share

NEAREST = 0.1  # [m] along the optical axis; what is nearer is not seen


@dataclass(frozen=True)
class GateCameraConfig(Camera):
    """A camera, and the network that finds the corners of gates' openings in its pictures."""

    range: Annotated[float, unit("m", gt=0, le=1000)] = 20.0  # farther corners are not found
    latency: Latency = 0.0  # from exposure to corners [s]
    noise: Annotated[float, unit("px", ge=0, le=1000)] = (
        1.0  # standard deviation of a found corner, per axis
    )
    misses: Share = 0.0  # of the corners in view
    outliers: Share = 0.0  # of those found: anywhere in the picture
    # of those found: taken for another corner of the course, a false association
    swaps: Share = 0.0
    dies_at: Annotated[float, unit("s", ge=0, le=1e5)] | None = None  # from then on it is silent

    def local(self, points: np.ndarray) -> np.ndarray:
        """Points of the body frame in the camera frame.  (n, 3)"""
        return (points - self.position) @ self.axes

    def seen(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points of the body frame (n, 3) [m] -> pixels (n, 2), and whether each is in front and in
        the picture."""
        pixels, depth = self.to_pixels(self.local(points))
        return pixels, (depth > NEAREST) & self.in_picture(pixels)
