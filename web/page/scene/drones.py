"""Drones, trails and sampled trajectories in the scene, in the colours of the legend.

The page's renderer (three.js) reads colours in an array, of lines or batched meshes, as linear
light, and a single colour of a mesh or of lines as sRGB, and maps both by its fit of the ACES
filmic curve. Unmodified colours would look pale, so the map x -> sRGB(O f(I x / 0.6)) is inverted
here. (Stephen Hill's fit, in tonemapping_pars_fragment.glsl.js)
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import trimesh
import viser
from matplotlib import colormaps
from trimesh.creation import box, cylinder
from trimesh.transformations import rotation_matrix, translation_matrix
from trimesh.util import concatenate

from quadsim.web.race.competitor import POSITION, QUATERNION, Competitor

TRAIL = 80  # segments of a trail
TRAIL_SPAN = 4.0  # duration of a trail [s]
PATH = 500  # segments of a whole run
DASH = 2  # segments of a dash, and of the gap after it
FAST = 16.0  # speed of the brightest colour [m/s]
SPAN = 0.34  # distance from rotor to rotor of a drone [m]
ROTOR_COLOUR = (205, 208, 212)

RGB = tuple[int, int, int]

# I
INTO = np.array(
    [[0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]]
)
# O
OUT = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)
EXPOSURE = 0.6
# intensity of a light under which a mesh shows its own colour, as its reflection is colour / pi
BRIGHT = np.pi


class DrawnFrame(NamedTuple):
    """The state of a drone's display."""

    frame: int
    by_speed: bool


class Drone:
    """One competitor's drone and trail.

    The arrays keep their length: viser accepts a different length, but draws it wrong.

    Args:
        name: name of its nodes.
        ghost: whether the drone is drawn paler, as all but the first.
        is_named: whether its name stands above it.
        scale: factor on the size of the drone.
        width: factor on the width of lines.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        entry: Competitor,
        ghost: bool,
        is_named: bool,
        scale: float,
        width: float,
    ):
        node = f"/competitor/{name}"
        colour = entry.style.rgb
        self._dashed = bool(entry.style.dash)  # as its line in the charts
        self._colours = np.tile(array_colour(colour), (TRAIL, 2, 1))
        self._shown = DrawnFrame(frame=-1, by_speed=False)
        self._frame = scene.add_frame(node, show_axes=False)
        opacity = 0.45 if ghost else None
        add_quadrotor(scene, node, SPAN * scale, colour, ROTOR_COLOUR, opacity)
        self._trail = scene.add_line_segments(
            f"/trail/{name}",
            np.zeros((TRAIL, 2, 3), np.float32),
            self._colours,
            thickness=width * (0.035 if ghost else 0.06),
        )
        if is_named:
            scene.add_label(f"{node}/name", entry.name, position=(0.0, 0.0, 0.5 * width))
        if not entry.live:
            frames = np.linspace(0, len(entry.t) - 1, PATH + 1).astype(int)
            path = self._segments(entry.rows(POSITION, frames).astype(np.float32))
            shade = single_colour(colour)
            scene.add_line_segments(f"/path/{name}", path, shade, thickness=0.03 * width)

    def show(self, entry: Competitor, i: int, by_speed: bool) -> None:
        """Show the drone at frame i, with its trail coloured by speed or by sampler."""
        asked = DrawnFrame(i, by_speed)
        if asked == self._shown:
            return
        recoloured = by_speed != self._shown.by_speed
        self._shown = asked
        self._frame.position = entry.rows(POSITION, i)
        self._frame.wxyz = entry.rows(QUATERNION, i)
        # The ends of the segments, and so the dashes, are fixed while the drone flies on.
        piece = TRAIL_SPAN / TRAIL  # [s]
        t = piece * (np.floor(entry.t[i] / piece) + np.arange(1 - TRAIL, 2))
        t = np.clip(t, 0.0, entry.t[i])
        frames = np.searchsorted(entry.t, t, side="right") - 1
        first = int(entry.t[i] / piece)
        self._trail.points = self._segments(entry.rows(POSITION, frames), first)
        if by_speed:
            self._trail.colors = segments(shades_of(entry.speed(frames) / FAST))
        elif recoloured:
            self._trail.colors = self._colours

    def _segments(self, points: np.ndarray, first: int = 0) -> np.ndarray:
        """Return the segments of a line, dashed if the drone's line is.

        Args:
            points: (n, 3)
            first: number of the first segment since the start, by which dashes are counted.
        """
        pieces = segments(points)
        if self._dashed:
            gaps = (first + np.arange(len(pieces))) % (2 * DASH) >= DASH
            pieces[gaps, 1] = pieces[gaps, 0]
        return pieces


class ExpectedPathsView:
    """A competitor's predicted paths of the others, as thin lines in the competitor's colour.

    Args:
        name: name of the node.
        entry: the competitor.
        width: factor on the width of lines.
    """

    PATHS = 7
    POINTS = 11

    def __init__(self, scene: viser.SceneApi, name: str, entry: Competitor, width: float):
        self._lines = scene.add_line_segments(
            f"/expected/{name}",
            np.zeros((self.PATHS * (self.POINTS - 1), 2, 3), np.float32),
            single_colour(entry.style.rgb),
            thickness=0.025 * width,
            visible=False,
        )
        self._shown: tuple[np.ndarray, ...] = ()

    def show(self, paths: tuple[np.ndarray, ...]) -> None:
        """Show paths  (points, 3) each; none: hide the lines."""
        if paths is self._shown:
            return
        self._shown = paths
        self._lines.visible = bool(paths)
        if paths:
            # The array keeps its length: fewer paths are repeated.
            rows = np.arange(self.PATHS) % len(paths)
            lines = segments(resampled(np.array(paths), self.POINTS)[rows])
            self._lines.points = lines.reshape(-1, 2, 3).astype(np.float32)


class SampledTrajectoriesView:
    """The sampled trajectories, brightest for the least cost, and the plan in white.

    They are sorted by cost, so that colours are sent only once.

    Args:
        samples: number of drawn trajectories.
        width: factor on the width of lines.
    """

    POINTS = 25

    def __init__(self, scene: viser.SceneApi, samples: int, width: float):
        pieces = self.POINTS - 1
        self._count = samples
        shades = array_colour(ramp(np.linspace(1.0, 0.05, samples)) * 0.8)
        colours = np.repeat(np.repeat(shades, pieces, axis=0)[:, None], 2, axis=1)
        self._samples = scene.add_line_segments(
            "/sampled_trajectories/samples",
            np.zeros((samples * pieces, 2, 3), np.float32),
            colours,
            thickness=0.014 * width,
            visible=False,
        )
        self._plan = scene.add_line_segments(
            "/sampled_trajectories/plan",
            np.zeros((pieces, 2, 3), np.float32),
            (255, 255, 255),
            thickness=0.045 * width,
            visible=False,
        )

    def show(self, paths: np.ndarray | None, plan: np.ndarray | None = None) -> None:
        """Show trajectories and the plan; None: hide them.

        Args:
            paths: (samples, points, 3); fewer samples than there are lines are repeated.
            plan: (points, 3)
        """
        self._samples.visible = paths is not None
        self._plan.visible = plan is not None
        if paths is not None:
            rows = np.arange(self._count) * len(paths) // self._count
            lines = segments(resampled(paths, self.POINTS)[rows])
            self._samples.points = lines.reshape(-1, 2, 3)
        if plan is not None:
            self._plan.points = segments(plan)


def resampled(paths: np.ndarray, points: int) -> np.ndarray:
    """Return the same paths with this number of points.  (samples, points, 3)"""
    last = paths.shape[1] - 1
    at = np.linspace(0, last, points)
    low = np.minimum(at.astype(int), last - 1)
    share = (at - low)[None, :, None]
    return (1 - share) * paths[:, low] + share * paths[:, low + 1]


def segments(points: np.ndarray) -> np.ndarray:
    """Return the segments between neighbouring points.  (..., n, 3) -> (..., n - 1, 2, 3)"""
    return np.stack([points[..., :-1, :], points[..., 1:, :]], axis=-2)


def ramp(share: np.ndarray) -> np.ndarray:
    """Return colours of 0..1, dark to bright: plasma without its darkest eighth.

    Returns:
        (n,) -> (n, 3) uint8
    """
    return colormaps["plasma"](0.125 + 0.875 * np.clip(share, 0.0, 1.0), bytes=True)[..., :3]


@cache
def _shades() -> np.ndarray:
    """Return colours for an array at 256 shares of the ramp, see `array_colour`.  (256, 3) uint8"""
    return array_colour(ramp(np.linspace(0.0, 1.0, 256)))


def shades_of(share: np.ndarray) -> np.ndarray:
    """Return the ramp's colours at shares (n,) of 0 to 1, for an array.  (n, 3) uint8"""
    return _shades()[(255 * np.clip(share, 0.0, 1.0)).astype(int)]


def add_quadrotor(
    scene: viser.SceneApi,
    node: str,
    span: float,
    body: RGB,
    rotors: RGB,
    opacity: float | None = None,
) -> None:
    """Add a quadrotor to a scene.

    Args:
        span: distance from rotor to rotor [m]
        body, rotors: their colours.
        opacity: opacity of the whole mesh; None: the body is opaque, the rotors translucent.
    """
    meshes = quadrotor(span)
    look = {"flat_shading": True, "side": "double"}
    for part, colour, own_opacity in (("body", body, 1.0), ("rotors", rotors, 0.8)):
        mesh = meshes[part]
        scene.add_mesh_simple(
            f"{node}/{part}",
            mesh.vertices,
            mesh.faces,
            color=single_colour(colour),
            opacity=own_opacity if opacity is None else opacity,
            **look,
        )


def quadrotor(span: float) -> dict[str, trimesh.Trimesh]:
    """Return an X frame: a body with its nose forward, and four rotor discs.

    span: distance from rotor to rotor [m].
    """
    side = 0.5 * span / np.sqrt(2)
    thick = 0.05 * span
    arm = (span, 2 * thick, 1.4 * thick)
    arms = [box(arm, rotation_matrix(angle, (0, 0, 1))) for angle in (np.pi / 4, -np.pi / 4)]
    ahead = translation_matrix((0.11 * span, 0, 0))
    nose = box((0.42 * span, 4.4 * thick, 3.08 * thick), ahead)
    discs = []
    for x in (-side, side):
        for y in (-side, side):
            hub = translation_matrix((x, y, 1.2 * thick))
            discs.append(cylinder(0.26 * span, 0.01 * span, sections=20, transform=hub))
    return {"body": concatenate([*arms, nose]), "rotors": concatenate(discs)}  # pyright: ignore[reportReturnType]


def array_colour(rgb: RGB | np.ndarray) -> np.ndarray:
    """Return array colours that look like these sRGB colours.  (..., 3) uint8"""
    return np.rint(255 * _linear(rgb)).astype(np.uint8)


def single_colour(rgb: RGB | np.ndarray) -> RGB:
    """Return the colour of an object whose lit side is to look like this sRGB colour, 0..255."""
    red, green, blue = np.rint(255 * encoded(_linear(rgb))).astype(int).tolist()
    return red, green, blue


def add_lights(scene: viser.SceneApi) -> None:
    """Replace viser's lights, which change all colours and are slower to render."""
    scene.configure_default_lights(False)
    scene.configure_environment_map(None)
    scene.add_light_ambient("/light/all", intensity=0.8 * BRIGHT)
    scene.add_light_directional("/light/above", intensity=0.25 * BRIGHT)


def decoded(srgb: np.ndarray) -> np.ndarray:
    """Return sRGB in 0..1 as linear light."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def encoded(linear: np.ndarray) -> np.ndarray:
    """Return linear light as sRGB in 0..1, the inverse of decoded."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _linear(rgb: RGB | np.ndarray) -> np.ndarray:
    """Return linear light that is shown as these sRGB colours, clipped to 0..1."""
    y = decoded(np.asarray(rgb) / 255) @ np.linalg.inv(OUT).T
    # f(v) = (v (v + 0.0245786) - 0.000090537) / (v (0.983729 v + 0.432951) + 0.238081) = y is
    # solved for v.
    a = 1 - 0.983729 * y
    b = 0.0245786 - 0.432951 * y
    c = -0.000090537 - 0.238081 * y
    v = (np.sqrt(b * b - 4 * a * c) - b) / (2 * a)
    return np.clip(EXPOSURE * v @ np.linalg.inv(INTO).T, 0.0, 1.0)
