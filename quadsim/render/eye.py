"""The renderer of a pixel camera, which draws a flight's pictures as a camera delivers them."""

from __future__ import annotations

import io
from dataclasses import replace
from math import cos, pi, sin

import numpy as np
from PIL import Image

from quadsim.course import Course
from quadsim.render.faces import Banner
from quadsim.render.look import Look, plain_look, venue_look
from quadsim.render.raster import Film
from quadsim.render.scene import Picture, Scene, Views
from quadsim.sensing.config import PixelCameraConfig
from quadsim.streams import picture_streams

# Rows and columns by which the noise of a picture is larger than the picture: it is shifted at
# random from picture to picture, as drawing new noise takes as long as drawing the picture.
SPARE = 61
# Banners: largest number of draws for one, least distance to gates [m], ranges of width and
# height [m]
TRIES = 100
APART = 2.5
WIDE = (0.8, 3.0)
HIGH = (0.4, 1.2)


class CourseEye:
    """Renders a course as a pixel camera sees it."""

    def __init__(
        self,
        config: PixelCameraConfig,
        seeds: np.random.SeedSequence,
        course: Course,
        look: Look | None = None,
    ):
        """Prepare the scene.

        Args:
            config: the camera.
            seeds: random stream of the noise, the look and the banners.
            course: the course with true positions.
            look: paint, light and sky; None: random or plain, as the camera's settings say.
        """
        streams = picture_streams(seeds)
        self._config = config
        self._scene = Scene(
            course, config, banners=drawn_banners(config.banners, course, streams.banners)
        )
        if look is None:
            look = venue_look(streams.look) if config.varied else plain_look()
        self._look = look
        self._rng = np.random.default_rng(streams.noise)
        shape = (3, config.height + SPARE, config.width + SPARE)
        noisy = config.read_noise > 0.0 or config.shot_noise > 0.0
        self._grain = self._rng.standard_normal(shape if noisy else (3, 1, 1), np.float32)

    def __call__(self, eyes: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Return a picture; see quadsim.sensing.pixel_camera.Eye."""
        return self._delivered(self._scene.colours(Views(eyes, axes), self._look, self._film()))

    def picture(self, eyes: np.ndarray, axes: np.ndarray) -> Picture:
        """Return a picture with the depth and the segmentation of the first pass."""
        picture = self._scene.expose(Views(eyes, axes), self._look, self._film())
        return replace(picture, rgb=self._delivered(picture.rgb))

    def _film(self) -> Film:
        """Return the gain and the noise of the next picture."""
        config = self._config
        row, column = self._rng.integers(0, SPARE, 2).tolist()
        return Film(
            gain=config.brightness,
            read=config.read_noise,
            shot=config.shot_noise,
            grain=self._grain,
            shift=(row, column),
        )

    def _delivered(self, rgb: np.ndarray) -> np.ndarray:
        """Return a picture as the camera delivers it, compressed if the camera compresses."""
        return compressed(rgb, self._config.jpeg) if self._config.jpeg else rgb


def drawn_banners(count: int, course: Course, seeds: np.random.SeedSequence) -> list[Banner]:
    """Return random banners within the bounds of a course, away from its gates and its start."""
    rng = np.random.default_rng(seeds)
    (x0, x1), (y0, y1), _ = course.bounds
    places = [*(gate.position for gate in course.gates), course.start.position]
    found: list[Banner] = []
    for _ in range(count * TRIES):
        if len(found) == count:
            break
        x = rng.uniform(x0, x1)
        y = rng.uniform(y0, y1)
        width = rng.uniform(*WIDE)
        height = rng.uniform(*HIGH)
        yaw = rng.uniform(0.0, pi)
        across = np.array([-sin(yaw), cos(yaw)])
        ends = [np.array([x, y]) + side * width * across for side in (-0.5, 0.0, 0.5)]
        away = min(np.linalg.norm(end - place[:2]) for end in ends for place in places)
        if away > APART:
            found.append(Banner((x, y, height / 2 + 0.02), yaw, (width, height)))
    return found


def compressed(rgb: np.ndarray, quality: int) -> np.ndarray:
    """Return a picture after JPEG compression of this quality.  (height, width, 3) uint8"""
    data = io.BytesIO()
    Image.fromarray(rgb).save(data, "jpeg", quality=quality)
    return np.asarray(Image.open(data).convert("RGB"))
