"""What moves in the scene, drones, trails and sampled trajectories, in the colours of the legend.

The page's renderer (three.js) takes colours in an array, of lines or batched meshes, as linear
light, a single colour of a mesh or of lines as sRGB, and maps both by its fit of the ACES filmic
curve: sent as they are, all come out pale. That mapping, x -> sRGB(O f(I x / 0.6)), is inverted
here. (Stephen Hill's fit, in tonemapping_pars_fragment.glsl.js)
"""

from __future__ import annotations

from functools import cache

import numpy as np
import trimesh
import viser
from matplotlib import colormaps
from trimesh.creation import box, cylinder
from trimesh.transformations import rotation_matrix, translation_matrix
from trimesh.util import concatenate

from web.competitor import POSITION, QUATERNION, Competitor

TRAIL, TRAIL_SPAN = 160, 4.0  # segments, and the seconds they span
PATH = 500  # segments of a whole run
FAST = 16.0  # [m/s] the bright end of the speed colours
SPAN = 0.34  # of a drone from rotor to rotor [m]

# I
INTO = np.array(
    [[0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]]
)
# O
OUT = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)
EXPOSURE = 0.6
# intensity of a light under which a mesh has its own colour, its reflection being colour / pi
BRIGHT = np.pi


class Drone:
    """One competitor's drone and trail. The arrays keep their length: viser accepts another one,
    but draws it wrong."""

    def __init__(
        self,
        scene: viser.SceneApi,
        name: str,
        entry: Competitor,
        ghost: bool,
        scale: float,
        width: float,
    ):
        """ghost: drawn paler and with its name, as every competitor but the first; width: factor on
        that of lines."""
        node = f"/competitor/{name}"
        colour = entry.style.rgb
        self._frame = scene.add_frame(node, show_axes=False)
        self._shown = -1, False  # frame, and whether coloured by speed
        for part, mesh in quadrotor(SPAN * scale).items():
            shade = single_colour(colour if part == "body" else (205, 208, 212))
            opacity = 0.45 if ghost else 1.0 if part == "body" else 0.8
            look = {"color": shade, "opacity": opacity, "flat_shading": True, "side": "double"}
            scene.add_mesh_simple(f"{node}/{part}", mesh.vertices, mesh.faces, **look)
        none = np.zeros((TRAIL, 2, 3), np.float32)
        self._dashed = entry.again  # as its line in the charts
        self._colours = np.tile(array_colour(colour), (TRAIL, 2, 1))
        self._trail = scene.add_line_segments(
            f"/trail/{name}", none, self._colours, thickness=width * (0.035 if ghost else 0.06)
        )
        if ghost:
            scene.add_label(f"{node}/name", entry.name, position=(0.0, 0.0, 0.5 * width))
        if not entry.live:
            rows = np.linspace(0, len(entry.t) - 1, PATH + 1).astype(int)
            path = self._segments(entry.rows(POSITION, rows).astype(np.float32))
            scene.add_line_segments(
                f"/path/{name}", path, single_colour(colour), thickness=0.03 * width
            )

    def show(self, entry: Competitor, i: int, by_speed: bool) -> None:
        """At frame i, with its trail coloured by speed or by sampler."""
        if (i, by_speed) == self._shown:
            return
        recoloured, self._shown = by_speed != self._shown[1], (i, by_speed)
        self._frame.position = entry.rows(POSITION, i)
        self._frame.wxyz = entry.rows(QUATERNION, i)
        # its ends stand still while the drone flies on: so do the dashes
        piece = TRAIL_SPAN / TRAIL
        t = piece * (np.floor(entry.t[i] / piece) + np.arange(1 - TRAIL, 2))
        t = np.clip(t, 0.0, entry.t[i])
        rows = np.searchsorted(entry.t, t, side="right") - 1
        self._trail.points = self._segments(entry.rows(POSITION, rows), int(entry.t[i] / piece))
        if by_speed:
            self._trail.colors = segments(shades_of(entry.speed(rows) / FAST))
        elif recoloured:
            self._trail.colors = self._colours

    def _segments(self, points: np.ndarray, first: int = 0) -> np.ndarray:
        pieces = segments(points)
        if self._dashed:
            gaps = (first + np.arange(len(pieces))) % 6 >= 3
            pieces[gaps, 1] = pieces[gaps, 0]
        return pieces


class SampledTrajectoriesView:
    """The samples, cheapest bright, and the plan in white. They come sorted by cost, so colours are
    sent only once."""

    POINTS = 25

    def __init__(self, scene: viser.SceneApi, samples: int, width: float):
        self._n, p = samples, self.POINTS
        shades = np.repeat(array_colour(ramp(np.linspace(1.0, 0.05, samples)) * 0.8), p - 1, axis=0)
        colours = np.repeat(shades[:, None], 2, axis=1)  # (samples * (p - 1), 2, 3)
        none, nothing = (
            np.zeros((len(colours), 2, 3), np.float32),
            np.zeros((p - 1, 2, 3), np.float32),
        )
        name, white = "/sampled_trajectories", (255, 255, 255)
        self._samples = scene.add_line_segments(
            f"{name}/samples", none, colours, thickness=0.014 * width, visible=False
        )
        self._plan = scene.add_line_segments(
            f"{name}/plan", nothing, white, thickness=0.045 * width, visible=False
        )

    def show(self, paths: np.ndarray | None, nominal: np.ndarray | None = None) -> None:
        """paths (samples, points, 3), None: hidden; fewer samples than there are lines are
        repeated."""
        self._samples.visible, self._plan.visible = paths is not None, nominal is not None
        if paths is not None:
            rows = np.arange(self._n) * len(paths) // self._n
            self._samples.points = segments(resampled(paths, self.POINTS)[rows]).reshape(-1, 2, 3)
        if nominal is not None:
            self._plan.points = segments(nominal)


def resampled(paths: np.ndarray, points: int) -> np.ndarray:
    """The same paths with another number of points.  (samples, points, 3)"""
    at = np.linspace(0, paths.shape[1] - 1, points)
    low = np.minimum(at.astype(int), paths.shape[1] - 2)
    share = (at - low)[None, :, None]
    return (1 - share) * paths[:, low] + share * paths[:, low + 1]


def segments(points: np.ndarray) -> np.ndarray:
    """(..., n, 3) -> (..., n - 1, 2, 3)"""
    return np.stack([points[..., :-1, :], points[..., 1:, :]], axis=-2)


def ramp(share: np.ndarray) -> np.ndarray:
    """Colours of 0..1, dark to bright, without plasma's darkest eighth.  (n,) -> (n, 3) uint8"""
    return colormaps["plasma"](0.125 + 0.875 * np.clip(share, 0.0, 1.0), bytes=True)[..., :3]


@cache
def _shades() -> np.ndarray:
    """What to send for 256 shares of the ramp.  (256, 3) uint8"""
    return array_colour(ramp(np.linspace(0.0, 1.0, 256)))


def shades_of(share: np.ndarray) -> np.ndarray:
    """The ramp's colours of 0..1, to be sent in an array.  (n,) -> (n, 3) uint8"""
    return _shades()[(255 * np.clip(share, 0.0, 1.0)).astype(int)]


def quadrotor(span: float) -> dict[str, trimesh.Trimesh]:
    """An X frame: a body with its nose forward, and four rotor discs."""
    a, w = 0.5 * span / np.sqrt(2), 0.05 * span
    arms = [
        box((span, 2 * w, 1.4 * w), rotation_matrix(angle, (0, 0, 1)))
        for angle in (np.pi / 4, -np.pi / 4)
    ]
    nose = box((0.42 * span, 4.4 * w, 3.08 * w), translation_matrix((0.11 * span, 0, 0)))
    hubs = [translation_matrix((x, y, 1.2 * w)) for x in (-a, a) for y in (-a, a)]
    discs = [cylinder(0.26 * span, 0.01 * span, sections=20, transform=hub) for hub in hubs]
    return {"body": concatenate([*arms, nose]), "rotors": concatenate(discs)}  # pyright: ignore[reportReturnType]


def array_colour(rgb: tuple[int, int, int] | np.ndarray) -> np.ndarray:
    """To be sent in an array for what is to look like this sRGB colour.  (..., 3) uint8, as
    given"""
    return np.rint(255 * _linear(rgb)).astype(np.uint8)


def single_colour(rgb: tuple[int, int, int] | np.ndarray) -> tuple[int, int, int]:
    """To be sent alone for what is to look like this sRGB colour; of a mesh, its lit side."""
    red, green, blue = np.rint(255 * encoded(_linear(rgb))).astype(int).tolist()
    return red, green, blue


def add_lights(scene: viser.SceneApi) -> None:
    """Instead of viser's own, which leave no colour as it is; these cost less to draw."""
    scene.configure_default_lights(False)
    scene.configure_environment_map(None)
    scene.add_light_ambient("/light/all", intensity=0.8 * BRIGHT)
    scene.add_light_directional("/light/above", intensity=0.25 * BRIGHT)


def decoded(srgb: np.ndarray) -> np.ndarray:
    """sRGB in 0..1 as linear light."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def encoded(linear: np.ndarray) -> np.ndarray:
    """The inverse of decoded."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def _linear(rgb: tuple[int, int, int] | np.ndarray) -> np.ndarray:
    """Linear light that is shown as this sRGB colour, or as near as 0..1 allows."""
    y = decoded(np.asarray(rgb) / 255) @ np.linalg.inv(OUT).T
    # f(v) = (v (v + 0.0245786) - 0.000090537) / (v (0.983729 v + 0.432951) + 0.238081) = y, solved
    # for v
    a, b, c = 1 - 0.983729 * y, 0.0245786 - 0.432951 * y, -0.000090537 - 0.238081 * y
    v = (np.sqrt(b * b - 4 * a * c) - b) / (2 * a)
    return np.clip(EXPOSURE * v @ np.linalg.inv(INTO).T, 0.0, 1.0)
