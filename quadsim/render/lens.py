"""Pictures of a lens with distortion, which are resampled from pictures of a pinhole.

The pinhole's picture has the same focal lengths, and is large enough to contain all rays of the
lens's picture. Colours are interpolated between four pixels; depth and face are taken from the
nearest pixel.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.render.raster import WHOLE, bend
from quadsim.sensing.camera import LensCamera

# Width [px] of the border around the needed part of the pinhole's picture
BORDER = 2


class Pinhole(NamedTuple):
    """The picture from which the lens's picture is resampled."""

    # height and width [px]
    shape: tuple[int, int]
    # focal lengths and the place of the optical axis, fx, fy, cx, cy [px]
    lens: tuple[float, float, float, float]


class Distortion:
    """The resampling of a picture of a pinhole into a picture of a lens.

    Args:
        camera: a camera with distortion.
    """

    def __init__(self, camera: LensCamera):
        # The place of each pixel's middle in the pinhole's picture, from the axis.
        v, u = np.indices((camera.height, camera.width)) + 0.5
        rays = camera.rays(np.stack([u, v], axis=-1))
        places = rays * (camera.fx, camera.fy)  # (height, width, 2)

        # The pinhole's picture reaches BORDER further than the furthest of them.
        half = np.ceil(abs(places).max(axis=(0, 1))).astype(int) + BORDER
        width, height = (2 * half).tolist()
        self.pinhole = Pinhole(
            (height, width),
            (float(camera.fx), float(camera.fy), width / 2, height / 2),
        )

        # The pixel whose middle is left of and above each place, and the way on from there.
        begin = places + half - 0.5
        corner = np.floor(begin).astype(int)
        share = np.rint((begin - corner) * WHOLE).astype(np.int16)
        self._corner = (corner[..., 1] * width + corner[..., 0]).ravel().astype(np.int32)
        self._right = share[..., 0].ravel()
        self._down = share[..., 1].ravel()
        nearest = np.rint(begin).astype(int)
        self._nearest = nearest[..., 1] * width + nearest[..., 0]

    def colours(self, rgb: np.ndarray) -> np.ndarray:
        """Return the lens's colours from the colours of the pinhole.

        Args:
            rgb: colours of the pinhole's picture, as in quadsim.render.raster.Drawn.

        Returns:
            The colours  (height, width, 3) uint8.
        """
        bent = np.empty((*self._nearest.shape, 3), np.uint8)
        bend(rgb, self._corner, self._right, self._down, bent.reshape(-1))
        return bent

    def nearest(self, values: np.ndarray) -> np.ndarray:
        """Return, for each pixel of the lens, the value of the nearest pixel of the pinhole.

        Args:
            values: values of the pinhole's pixels, such as depths or faces.

        Returns:
            The values  (height, width)."""
        return values.ravel()[self._nearest]
