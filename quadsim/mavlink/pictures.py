"""The vehicle's camera: pictures as JPEG files, cut into chunks for UDP."""

from __future__ import annotations

import io
from collections.abc import Iterator
from struct import Struct

import numpy as np
from PIL import Image

from quadsim.controllers.lanes.compiled import is_cached
from quadsim.course import Course
from quadsim.render.look import plain_look
from quadsim.render.raster import draw, rows_of_faces
from quadsim.render.scene import Scene
from quadsim.rotation import Quaternion, Vec3
from quadsim.sensing.camera import Camera

# frame, chunk, chunks of the frame, length of the JPEG file, of this chunk [bytes], time [ns]
CHUNK = Struct("<IHHIIQ")
# Bytes of the JPEG file in one chunk: a packet of Ethernet holds it
LONGEST = 1400
QUALITY = 80


class Eye:
    """Takes the pictures of the flights.

    Attributes:
        rate: pictures a second [Hz].

    Args:
        course: the course as it stands.
        camera: the camera.
    """

    def __init__(self, course: Course, camera: Camera):
        self.rate = camera.rate
        self._scene = Scene(course, camera)
        self._look = plain_look()

    @property
    def is_compiled(self) -> bool:
        """Whether the loops that draw are in the cache of compiled code."""
        return is_cached(rows_of_faces) and is_cached(draw)

    def picture(self, p: Vec3, q: Quaternion) -> np.ndarray:
        """Return what the camera sees.

        Args:
            p: position of the vehicle [m].
            q: attitude of the vehicle, wxyz.

        Returns:
            Colours (height, width, 3) uint8.
        """
        return self._scene.shoot(p, q, self._look).rgb


def jpeg(colours: np.ndarray) -> bytes:
    """Return a picture as a JPEG file.

    Args:
        colours: (height, width, 3) uint8.
    """
    buffer = io.BytesIO()
    Image.fromarray(colours).save(buffer, "jpeg", quality=QUALITY)
    return buffer.getvalue()


def chunks(file: bytes, frame: int, boot: float) -> Iterator[bytes]:
    """Yield the datagrams of a picture.

    Args:
        file: the JPEG file.
        frame: number of the picture.
        boot: time of the picture since the simulator's start [s].
    """
    count = -(-len(file) // LONGEST)
    for k in range(count):
        piece = file[k * LONGEST : (k + 1) * LONGEST]
        yield CHUNK.pack(frame % 2**32, k, count, len(file), len(piece), round(1e9 * boot)) + piece
