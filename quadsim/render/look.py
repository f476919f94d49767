"""How a scene looks: paint of ground and gates, light, sky. The same always, or drawn from a seed.

Textures are made here, of noise: nothing is loaded. Noise of several octaves is a sum of grids of
random numbers, each twice as fine and half as strong as the one before (Perlin 1985), interpolated
linearly and periodic.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from quadsim.rotation import Vec3
from quadsim.streams import LookStreams, texture_stream

VARIED = ("textures", "light", "background")  # what can be drawn from a seed
SIZE = 128  # pixels of a texture's edge
CLOUDS = 512  # of the sky's
FLAT, CHEQUERED, TEXTURES = 0, 1, 24  # numbers of the first two textures, and how many there are
ORANGE, GREY, DARK = (0.9, 0.43, 0.1), (0.55, 0.58, 0.53), (0.3, 0.33, 0.42)
HORIZON, ZENITH = (214, 226, 236), (96, 150, 214)


class Paint(NamedTuple):
    """The colour of a body times a texture."""

    texture: int  # of `textures`
    colour: Vec3  # 0 to 1


@dataclass(frozen=True, eq=False)
class Look:
    """What a picture shows beside the shapes."""

    ground: Paint
    gates: tuple[Paint, ...]  # of the gates in turn
    obstacles: Paint
    light: Vec3  # towards the sun
    light_colour: Vec3  # 0 to 1
    ambient: float  # shares of the light
    diffuse: float
    specular: float
    # of directions in the world, unit length (n, 3) -> colours (n, 3) uint8
    sky: Callable[[np.ndarray], np.ndarray]


def plain_look() -> Look:
    """Orange gates and dark obstacles on a chequered grey ground under a blue sky, the sun high."""
    sun, white = (0.4, 0.3, 1.0), (1.0, 1.0, 1.0)
    paints = Paint(CHEQUERED, GREY), (Paint(FLAT, ORANGE),), Paint(FLAT, DARK)
    return Look(*paints, sun, white, 0.6, 0.35, 0.05, _gradient(HORIZON, ZENITH))


def drawn_look(streams: LookStreams, vary: Collection[str]) -> Look:
    """Return the plain look with what is in `vary` (of VARIED) drawn anew. The same streams give
    the same look."""
    look = plain_look()
    if "textures" in vary:
        rng = np.random.default_rng(streams.textures)
        ground, obstacles, *gates = (_paint(rng) for _ in range(5))
        look = replace(look, ground=ground, obstacles=obstacles, gates=tuple(gates))
    if "light" in vary:
        look = replace(look, **_light(np.random.default_rng(streams.light)))
    if "background" in vary:
        look = replace(look, sky=_clouds(np.random.default_rng(streams.background)))
    return look


def textures() -> list[np.ndarray]:
    """The same ones always, as a renderer loads each once.  TEXTURES of (SIZE, SIZE, 3) uint8"""
    rng = np.random.default_rng(texture_stream())
    squares = (np.indices((SIZE, SIZE)) // (SIZE // 2)).sum(axis=0)[..., None] % 2
    flat, chequered = (
        np.full((SIZE, SIZE, 3), 255, np.uint8),
        np.where(squares, 255, 215).astype(np.uint8),
    )
    chequered = np.repeat(chequered, 3, axis=2)
    return [flat, chequered, *(_texture(rng) for _ in range(TEXTURES - 2))]


def noise(rng: np.random.Generator, size: int, octaves: int = 4) -> np.ndarray:
    """Smooth periodic noise between 0 and 1.  (size, size)"""
    total = np.zeros((size, size))
    for octave in range(octaves):
        n = 4 * 2**octave
        grid, at = rng.random((n, n)), np.arange(size) * n / size
        cell, share = at.astype(int), at % 1.0
        rows = grid[cell] + share[:, None] * (grid[(cell + 1) % n] - grid[cell])
        total += 0.5**octave * (rows[:, cell] + share * (rows[:, (cell + 1) % n] - rows[:, cell]))
    return (total - total.min()) / np.ptp(total)


def _texture(rng: np.random.Generator) -> np.ndarray:
    """Two random colours, mixed by noise, or by stripes with some."""
    first, second = rng.integers(40, 256, (2, 3))
    mix = noise(rng, SIZE)
    if rng.random() < 0.5:
        along = np.indices((SIZE, SIZE))[rng.integers(2)]
        stripes = (along * rng.integers(2, 9) // SIZE) % 2
        mix = 0.8 * stripes + 0.2 * mix
    return (first + mix[..., None] * (second - first)).astype(np.uint8)


def _paint(rng: np.random.Generator) -> Paint:
    red, green, blue = rng.uniform(0.2, 1.0, 3).tolist()
    return Paint(int(rng.integers(TEXTURES)), (red, green, blue))


def _light(rng: np.random.Generator) -> dict:
    """A sun anywhere 15 degrees or more above the horizon, of a colour near white; contrast weak to
    strong."""
    azimuth, elevation = rng.uniform(0.0, 2 * pi), rng.uniform(pi / 12, pi / 2)
    sun = (cos(azimuth) * cos(elevation), sin(azimuth) * cos(elevation), sin(elevation))
    ambient = rng.uniform(0.25, 0.75)
    colour = tuple(rng.uniform(0.75, 1.0, 3).tolist())
    diffuse, specular = rng.uniform(0.3, 0.9 - 0.4 * ambient), rng.uniform(0.0, 0.4)
    return {
        "light": sun,
        "light_colour": colour,
        "ambient": ambient,
        "diffuse": diffuse,
        "specular": specular,
    }


def _gradient(horizon: Vec3, zenith: Vec3) -> Callable[[np.ndarray], np.ndarray]:
    colours = np.linspace(horizon, zenith, 256).astype(np.uint8)

    def sky(directions: np.ndarray) -> np.ndarray:
        up = np.sqrt(np.clip(directions[:, 2], 0.0, 1.0))
        return colours[(up * 255).astype(np.uint8)]

    return sky


def _clouds(rng: np.random.Generator) -> Callable[[np.ndarray], np.ndarray]:
    """Random colours of horizon and zenith, and noise of a third colour that stands still in the
    world.

    The noise lies on the picture of the sky by stereographic projection from below: x / (1 + z), y
    / (1 + z).
    """
    horizon, zenith, cloud = rng.integers(0, 256, (3, 3))
    below = _gradient(horizon, zenith)
    cover = (noise(rng, CLOUDS) ** rng.uniform(0.5, 3.0)).astype(np.float32)
    cloud = cloud.astype(np.float32)

    def sky(directions: np.ndarray) -> np.ndarray:
        half = np.float32((CLOUDS - 1) / 2) / (np.float32(1.0) + np.maximum(directions[:, 2], 0.0))
        row, column = (
            ((CLOUDS - 1) / 2 + half * directions[:, axis]).astype(np.intp) for axis in (0, 1)
        )
        share = cover[row, column][:, None]
        return ((1.0 - share) * below(directions) + share * cloud).astype(np.uint8)

    return sky
