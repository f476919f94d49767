"""Looks of a scene: paint of ground and gates, light and sky, fixed or random from a seed.

Textures are computed from noise; no file is loaded. Noise of several octaves is a sum of periodic
grids of random numbers with linear interpolation; each grid is twice as fine and half as strong as
the previous one (Perlin 1985).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from quadsim.rotation import Vec3
from quadsim.sensing.pixels.signal import ORANGE
from quadsim.streams import LookStreams, texture_stream

VARIED = ("textures", "light", "background")  # parts that can be drawn from a seed
SIZE = 128  # pixels of a texture's edge
CLOUDS = 512  # pixels of the sky texture's edge
TEXTURES = 24  # number of textures that `_paint` draws from; the first two are not random
GREYS = 6  # number of grey textures after these, for the ground of a venue
FLAT = 0
CHEQUERED = 1
# colours, 0 to 1
GREY = (0.55, 0.58, 0.53)
DARK = (0.3, 0.33, 0.42)
WHITE = (1.0, 1.0, 1.0)
# colours of the plain sky, 0 to 255
HORIZON = (214, 226, 236)
ZENITH = (96, 150, 214)


class Sky(NamedTuple):
    """The colours of the sky by direction, 0 to 255.

    The colour depends on the elevation, and is mixed with the colour of clouds. The share of clouds
    is an image that is mapped to the sky by stereographic projection, x / (1 + z), y / (1 + z): its
    middle is the zenith, and its edges touch the horizon.
    """

    # colours at the horizon and at the zenith, between which they are linear in the square root of
    # the sine of the elevation  (3,) float32
    horizon: np.ndarray
    zenith: np.ndarray
    # shares of the cloud's colour, 0 to 1  (edge, edge) float32; (1, 1): no cloud
    cover: np.ndarray
    # colour of the clouds  (3,) float32
    cloud: np.ndarray


class Paint(NamedTuple):
    """A paint: a colour that multiplies a texture."""

    texture: int  # index in `textures`
    colour: Vec3  # 0 to 1


class Light(NamedTuple):
    """The light of the sun."""

    towards: Vec3  # direction of the sun
    colour: Vec3  # 0 to 1
    ambient: float  # shares of the light
    diffuse: float


@dataclass(frozen=True, eq=False)
class Look:
    """The appearance of a scene, apart from its shapes."""

    ground: Paint
    gates: tuple[Paint, ...]  # used for the gates in turn
    obstacles: Paint
    light: Light
    sky: Sky


def plain_look() -> Look:
    """Return orange gates and dark obstacles on chequered grey ground under a blue sky."""
    return Look(
        ground=Paint(CHEQUERED, GREY),
        gates=(Paint(FLAT, ORANGE),),
        obstacles=Paint(FLAT, DARK),
        light=Light(
            towards=(0.4, 0.3, 1.0),
            colour=WHITE,
            ambient=0.6,
            diffuse=0.4,
        ),
        sky=_gradient(HORIZON, ZENITH),
    )


def drawn_look(streams: LookStreams, vary: Collection[str]) -> Look:
    """Return the plain look, in which the parts named in `vary` (of VARIED) are random.

    The same streams give the same look.
    """
    look = plain_look()
    if "textures" in vary:
        rng = np.random.default_rng(streams.textures)
        ground, obstacles, *gates = (_paint(rng) for _ in range(5))
        look = replace(look, ground=ground, obstacles=obstacles, gates=tuple(gates))
    if "light" in vary:
        look = replace(look, light=_light(np.random.default_rng(streams.light)))
    if "background" in vary:
        look = replace(look, sky=_clouds(np.random.default_rng(streams.background)))
    return look


def venue_look(streams: LookStreams) -> Look:
    """Return the look of a random venue, in which few things share the colour of the gates.

    Ground and obstacles have muted colours, the sky is grey to blue with grey clouds, and the light
    is random as in `drawn_look`. Gates are painted as in the plain look.
    """
    rng = np.random.default_rng(streams.textures)
    ground = Paint(TEXTURES + int(rng.integers(GREYS)), _muted(rng))
    obstacles = Paint(TEXTURES + int(rng.integers(GREYS)), _muted(rng))
    sky = np.random.default_rng(streams.background)
    zenith = sky.uniform((40, 80, 120), (140, 170, 230))
    horizon = zenith + sky.uniform(0.2, 0.8) * (240 - zenith)
    cover = (noise(sky, CLOUDS) ** sky.uniform(0.5, 3.0)).astype(np.float32)
    cloud = np.full(3, sky.uniform(120, 250), np.float32)
    return replace(
        plain_look(),
        ground=ground,
        obstacles=obstacles,
        light=_light(np.random.default_rng(streams.light)),
        sky=_gradient(horizon, zenith)._replace(cover=cover, cloud=cloud),
    )


def textures() -> list[np.ndarray]:
    """Return all textures, which do not depend on a seed.

    Returns:
        TEXTURES coloured arrays, then GREYS grey arrays, each (SIZE, SIZE, 3) uint8.
    """
    rng = np.random.default_rng(texture_stream())
    flat = np.full((SIZE, SIZE, 3), 255, np.uint8)
    squares = (np.indices((SIZE, SIZE)) // (SIZE // 2)).sum(axis=0)[..., None] % 2
    chequered = np.repeat(np.where(squares, 255, 215).astype(np.uint8), 3, axis=2)
    coloured = [_texture(rng) for _ in range(TEXTURES - 2)]
    greys = [_texture(rng).mean(axis=2, keepdims=True) for _ in range(GREYS)]
    return [
        flat,
        chequered,
        *coloured,
        *(grey.repeat(3, axis=2).astype(np.uint8) for grey in greys),
    ]


def noise(rng: np.random.Generator, size: int, octaves: int = 4) -> np.ndarray:
    """Return smooth periodic noise between 0 and 1.  (size, size)"""
    total = np.zeros((size, size))
    for octave in range(octaves):
        n = 4 * 2**octave
        grid = rng.random((n, n))
        # the cell of each pixel, the next cell, and the pixel's fraction between the two
        at = np.arange(size) * n / size
        cell = at.astype(int)
        following = (cell + 1) % n
        share = at % 1.0
        rows = grid[cell] + share[:, None] * (grid[following] - grid[cell])
        total += 0.5**octave * (rows[:, cell] + share * (rows[:, following] - rows[:, cell]))
    return (total - total.min()) / np.ptp(total)


def _texture(rng: np.random.Generator) -> np.ndarray:
    """Return a texture that mixes two random colours by noise or stripes.  (SIZE, SIZE, 3)"""
    first, second = rng.integers(40, 256, (2, 3))
    mix = noise(rng, SIZE)
    if rng.random() < 0.5:
        along = np.indices((SIZE, SIZE))[rng.integers(2)]
        stripes = (along * rng.integers(2, 9) // SIZE) % 2
        mix = 0.8 * stripes + 0.2 * mix
    return (first + mix[..., None] * (second - first)).astype(np.uint8)


def _paint(rng: np.random.Generator) -> Paint:
    """Return a paint with a random colour and a random texture."""
    red, green, blue = rng.uniform(0.2, 1.0, 3).tolist()
    return Paint(int(rng.integers(TEXTURES)), (red, green, blue))


def _muted(rng: np.random.Generator) -> Vec3:
    """Return a random muted colour, whose parts differ by at most a seventh."""
    grey = rng.uniform(0.3, 0.9)
    red, green, blue = (grey * rng.uniform((0.86, 0.93, 0.9), (0.95, 1.0, 1.0))).tolist()
    return red, green, blue


def _light(rng: np.random.Generator) -> Light:
    """Return a random near-white sun, at least 15 degrees high, with weak to strong contrast."""
    azimuth = rng.uniform(0.0, 2 * pi)
    elevation = rng.uniform(pi / 12, pi / 2)
    ambient = rng.uniform(0.25, 0.75)
    red, green, blue = rng.uniform(0.75, 1.0, 3).tolist()
    return Light(
        towards=(
            cos(azimuth) * cos(elevation),
            sin(azimuth) * cos(elevation),
            sin(elevation),
        ),
        colour=(red, green, blue),
        ambient=ambient,
        diffuse=rng.uniform(0.3, 0.9 - 0.4 * ambient),
    )


def _gradient(horizon: Sequence[float] | np.ndarray, zenith: Sequence[float] | np.ndarray) -> Sky:
    """Return a sky whose colour changes from the horizon to the zenith."""
    return Sky(
        horizon=np.array(horizon, np.float32),
        zenith=np.array(zenith, np.float32),
        cover=np.zeros((1, 1), np.float32),
        cloud=np.zeros(3, np.float32),
    )


def _clouds(rng: np.random.Generator) -> Sky:
    """Return a sky with random colours of horizon and zenith, and noise of a third colour."""
    horizon, zenith, cloud = rng.integers(0, 256, (3, 3))
    cover = (noise(rng, CLOUDS) ** rng.uniform(0.5, 3.0)).astype(np.float32)
    return _gradient(horizon, zenith)._replace(cover=cover, cloud=cloud.astype(np.float32))
