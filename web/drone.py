"""What moves in the scene: the drones, their trails and paths, the sampled_trajectories of samples."""

from __future__ import annotations

import numpy as np
import viser

from quadsim.palette import style
from web.colours import ramp
from web.competitor import Competitor
from web.mesh import quadrotor

TRAIL, TRAIL_SPAN = 160, 4.0  # segments, and the seconds they span
PATH = 500  # segments of a whole run
FAST = 16.0  # [m/s] the bright end of the speed colours
SPAN = 0.34  # of a drone from rotor to rotor [m]


class Drone:
    """One competitor's marks. Arrays that change keep their length: viser takes any, and draws nonsense without a word."""

    def __init__(self, scene: viser.SceneApi, name: str, competitor: Competitor, ghost: bool, scale: float):
        self.name = f"/competitor/{name}"
        colour = style(competitor.sampler).rgb
        self._frame = scene.add_frame(self.name, show_axes=False)
        for part, (vertices, faces) in quadrotor(SPAN * scale).items():
            shade = colour if part == "body" else (225, 228, 232)
            opacity = 0.45 if ghost else (1.0 if part == "body" else 0.8)
            scene.add_mesh_simple(
                f"{self.name}/{part}", vertices, faces, color=shade, opacity=opacity, flat_shading=True, side="double"
            )
        none, dark = np.zeros((TRAIL, 2, 3), np.float32), np.zeros((TRAIL, 2, 3), np.uint8)
        width = 0.035 if ghost else 0.06
        self._trail = scene.add_line_segments(f"/trail/{name}", none, dark, thickness=width)
        self._lane_colour = np.broadcast_to(np.array(colour, np.uint8), (TRAIL, 2, 3))
        if ghost:
            scene.add_label(f"{self.name}/name", competitor.name, position=(0.0, 0.0, 0.5))
        if not competitor.live:
            scene.add_line_segments(f"/path/{name}", whole_path(competitor), np.array(colour) // 2, thickness=0.02)

    def show(self, competitor: Competitor, i: int, by_speed: bool) -> None:
        """The drone at frame i, and where it was before."""
        x = competitor.x
        self._frame.position = np.array([x[k][i] for k in ("px", "py", "pz")])
        self._frame.wxyz = np.array([x[k][i] for k in ("qw", "qx", "qy", "qz")])
        t = np.linspace(max(x["t"][i] - TRAIL_SPAN, 0.0), x["t"][i], TRAIL + 1)
        rows = np.searchsorted(x["t"], t, side="right") - 1
        points = np.stack([x[k][rows] for k in ("px", "py", "pz")], axis=1)
        speed = np.sqrt(sum(x[k][rows] ** 2 for k in ("vx", "vy", "vz")))
        self._trail.points = segments(points)
        self._trail.colors = segments(ramp(speed / FAST)) if by_speed else np.array(self._lane_colour)


class SampledTrajectoriesView:
    """The samples, cheapest bright; sorted by cost, so their colours never change and are never sent again."""

    POINTS = 25

    def __init__(self, scene: viser.SceneApi, samples: int = 63):
        self._n = samples
        n, p = samples, self.POINTS
        shades = np.repeat(ramp(np.linspace(1.0, 0.05, n)) * 0.8, p - 1, axis=0).astype(np.uint8)
        colours = np.repeat(shades[:, None], 2, axis=1)  # (n * (p - 1), 2, 3)
        self._samples = scene.add_line_segments(
            "/sampled_trajectories/samples",
            np.zeros((n * (p - 1), 2, 3), np.float32),
            colours,
            thickness=0.014,
            visible=False,
        )
        self._plan = scene.add_line_segments(
            "/sampled_trajectories/plan",
            np.zeros((p - 1, 2, 3), np.float32),
            (255, 255, 255),
            thickness=0.045,
            visible=False,
        )

    def show(self, paths: np.ndarray | None, nominal: np.ndarray | None = None) -> None:
        """paths (samples, points, 3), None: nothing to see. Fewer samples than the sampled_trajectories has are repeated."""
        for node, seen in ((self._samples, paths is not None), (self._plan, nominal is not None)):
            if node.visible != seen:
                node.visible = seen
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


def whole_path(competitor: Competitor) -> np.ndarray:
    rows = np.linspace(0, len(competitor.t) - 1, PATH + 1).astype(int)
    return segments(np.stack([competitor.x[k][rows] for k in ("px", "py", "pz")], axis=1).astype(np.float32))
