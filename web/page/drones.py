"""What moves in the scene: the drones with their trails, the sampled trajectories."""

from __future__ import annotations

import numpy as np
import viser

from quadsim.palette import style
from web.competitor import POSITION, QUATERNION, Competitor

TRAIL, TRAIL_SPAN = 160, 4.0  # segments, and the seconds they span
PATH = 500  # segments of a whole run
FAST = 16.0  # [m/s] the bright end of the speed colours
SPAN = 0.34  # of a drone from rotor to rotor [m]
BOX = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])  # (8, 3)
BOX_FACES = np.array(  # (12, 3)
    [
        *((0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5)),
        *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ]
)
# dark violet to yellow, equally spaced in lightness (after matplotlib's plasma)
PLASMA = np.array([(75, 3, 161), (125, 3, 168), (168, 34, 150), (203, 70, 121), (229, 107, 93), (248, 148, 65)])
PLASMA = np.vstack([PLASMA, (253, 195, 40), (240, 249, 33)])

Mesh = tuple[np.ndarray, np.ndarray]  # vertices (n, 3), faces (m, 3)


class Drone:
    """One competitor's drone and trail. The arrays keep their length: viser accepts another one, but draws it wrong."""

    def __init__(self, scene: viser.SceneApi, name: str, entry: Competitor, ghost: bool, scale: float):
        """ghost: drawn paler and with its name, as every competitor but the first."""
        self.name = f"/competitor/{name}"
        colour = style(entry.sampler).rgb
        self._frame = scene.add_frame(self.name, show_axes=False)
        for part, (vertices, faces) in quadrotor(SPAN * scale).items():
            shade = colour if part == "body" else (225, 228, 232)
            opacity = 0.45 if ghost else 1.0 if part == "body" else 0.8
            scene.add_mesh_simple(
                f"{self.name}/{part}", vertices, faces, color=shade, opacity=opacity, flat_shading=True, side="double"
            )
        none, dark = np.zeros((TRAIL, 2, 3), np.float32), np.zeros((TRAIL, 2, 3), np.uint8)
        self._trail = scene.add_line_segments(f"/trail/{name}", none, dark, thickness=0.035 if ghost else 0.06)
        self._colours = np.tile(np.array(colour, np.uint8), (TRAIL, 2, 1))
        if ghost:
            scene.add_label(f"{self.name}/name", entry.name, position=(0.0, 0.0, 0.5))
        if not entry.live:
            rows = np.linspace(0, len(entry.t) - 1, PATH + 1).astype(int)
            path = segments(entry.rows(POSITION, rows).astype(np.float32))
            scene.add_line_segments(f"/path/{name}", path, np.array(colour) // 2, thickness=0.02)

    def show(self, entry: Competitor, i: int, by_speed: bool) -> None:
        """At frame i, with its trail coloured by speed or by sampler."""
        self._frame.position = entry.rows(POSITION, i)
        self._frame.wxyz = entry.rows(QUATERNION, i)
        t = np.linspace(max(entry.t[i] - TRAIL_SPAN, 0.0), entry.t[i], TRAIL + 1)
        rows = np.searchsorted(entry.t, t, side="right") - 1
        self._trail.points = segments(entry.rows(POSITION, rows))
        self._trail.colors = segments(ramp(entry.speed(rows) / FAST)) if by_speed else self._colours.copy()


class SampledTrajectoriesView:
    """The samples, cheapest bright, and the plan in white. They come sorted by cost, so colours are sent only once."""

    POINTS = 25

    def __init__(self, scene: viser.SceneApi, samples: int):
        self._n, p = samples, self.POINTS
        shades = np.repeat(ramp(np.linspace(1.0, 0.05, samples)) * 0.8, p - 1, axis=0).astype(np.uint8)
        colours = np.repeat(shades[:, None], 2, axis=1)  # (samples * (p - 1), 2, 3)
        none, nothing = np.zeros((len(colours), 2, 3), np.float32), np.zeros((p - 1, 2, 3), np.float32)
        name, white = "/sampled_trajectories", (255, 255, 255)
        self._samples = scene.add_line_segments(f"{name}/samples", none, colours, thickness=0.014, visible=False)
        self._plan = scene.add_line_segments(f"{name}/plan", nothing, white, thickness=0.045, visible=False)

    def show(self, paths: np.ndarray | None, nominal: np.ndarray | None = None) -> None:
        """paths (samples, points, 3), None: hidden; fewer samples than there are lines are repeated."""
        for node, visible in ((self._samples, paths is not None), (self._plan, nominal is not None)):
            if node.visible != visible:
                node.visible = visible
        if paths is not None:
            rows = np.arange(self._n) * len(paths) // self._n
            points = np.concatenate([segments(p) for p in resampled(paths, self.POINTS)[rows]])
            if not np.array_equal(points, self._samples.points):
                self._samples.points = points
        if nominal is not None:
            self._plan.points = segments(nominal)


def resampled(paths: np.ndarray, points: int) -> np.ndarray:
    """The same paths with another number of points.  (samples, points, 3)"""
    at = np.linspace(0, paths.shape[1] - 1, points)
    low = np.minimum(at.astype(int), paths.shape[1] - 2)
    share = (at - low)[None, :, None]
    return (1 - share) * paths[:, low] + share * paths[:, low + 1]


def segments(points: np.ndarray) -> np.ndarray:
    """(n, 3) -> (n - 1, 2, 3)"""
    return np.stack([points[:-1], points[1:]], axis=1)


def ramp(share: np.ndarray) -> np.ndarray:
    """Colours of 0..1, dark to bright.  (n,) -> (n, 3) uint8"""
    at, k = np.clip(share, 0.0, 1.0) * (len(PLASMA) - 1), np.arange(len(PLASMA))
    return np.stack([np.interp(at, k, PLASMA[:, c]) for c in range(3)], axis=-1).astype(np.uint8)


def quadrotor(span: float) -> dict[str, Mesh]:
    """An X frame: a body with its nose forward, and four rotor discs."""
    a, w = 0.5 * span / np.sqrt(2), 0.05 * span
    nose = _prism((-0.1 * span, 0), (0.32 * span, 0), 2.2 * w)
    arms = [_prism((-a, -a), (a, a), w), _prism((-a, a), (a, -a), w), nose]
    discs = [_disc((x, y, 1.2 * w), 0.26 * span) for x in (-a, a) for y in (-a, a)]
    return {"body": _joined(arms), "rotors": _joined(discs)}


def _prism(a: tuple, b: tuple, w: float) -> Mesh:
    """A bar of width w from a to b in the body's plane."""
    along = np.subtract(b, a)
    length = np.linalg.norm(along)
    x, y = along / length
    rotation = np.array([(x, -y, 0.0), (y, x, 0.0), (0.0, 0.0, 1.0)])
    centre = np.append(np.add(a, b) / 2, 0.0)
    return BOX * (length, 2 * w, 1.4 * w) @ rotation.T + centre, BOX_FACES


def _disc(centre: tuple, radius: float, corners: int = 20) -> Mesh:
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    rim = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(corners)], axis=1)
    faces = [(0, 1 + k, 1 + (k + 1) % corners) for k in range(corners)]
    return np.vstack([np.zeros(3), rim]) + centre, np.array(faces)


def _joined(parts: list[Mesh]) -> Mesh:
    offsets = np.cumsum([0, *(len(v) for v, _ in parts[:-1])])
    faces = [f + offset for (_, f), offset in zip(parts, offsets, strict=True)]
    return np.vstack([v for v, _ in parts]).astype(np.float32), np.vstack(faces).astype(np.uint32)
