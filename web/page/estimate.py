"""What a vehicle with sensors makes of them: its estimate as a ghost with its 3-sigma ellipsoid,
and the corners of gates where its camera found them.
"""

from __future__ import annotations

import msgspec
import numpy as np
import viser
from viser.transforms import SO3

from quadsim.sensing.config import GateCameraConfig
from web.competitor import POSITION, QUATERNION, Competitor
from web.page.drones import SPAN, quadrotor, single_colour

EST_POSITION, EST_QUATERNION = (
    tuple(f"est_{name}" for name in names) for names in (POSITION, QUATERNION)
)
COVARIANCE = (
    "cov_xx",
    "cov_xy",
    "cov_xz",
    "cov_xy",
    "cov_yy",
    "cov_yz",
    "cov_xz",
    "cov_yz",
    "cov_zz",
)
SENSED = 0, 229, 255  # colour of all that is sensed or estimated
SIGMAS = 3.0
MOST = 64  # corners that are drawn
ARM = 0.02  # of a corner's cross, per metre of its distance
SHOWN = 0.25  # [s] for which corners are shown


class EstimateView:
    """Of one competitor that has an estimate. `scale` is that of its drone, and of the error and
    the ellipsoid with it: at their true size they would be hidden in a drone that is drawn larger
    than it is.
    """

    def __init__(self, scene: viser.SceneApi, name: str, entry: Competitor, scale: float):
        self._scale = scale
        node, body = f"/estimate/{name}", quadrotor(SPAN * scale)["body"]
        look = {"opacity": 0.35, "flat_shading": True, "side": "double"}
        self._ghost = scene.add_mesh_simple(
            f"{node}/ghost", body.vertices, body.faces, color=single_colour(SENSED), **look
        )
        colour = single_colour(SENSED)
        self._ellipsoid = scene.add_icosphere(
            f"{node}/ellipsoid", 1.0, colour, subdivisions=2, wireframe=True
        )
        none = np.zeros((2 * MOST, 2, 3), np.float32)
        self._corners = scene.add_line_segments(
            f"{node}/corners", none, single_colour(SENSED), thickness=0.05
        )
        self._shown: tuple[int, float | None] = -1, None

    def show(self, entry: Competitor, i: int) -> None:
        """At frame i, with the corners of the last picture if that was taken lately."""
        seen = (
            entry.corners
            if entry.corners and 0.0 <= entry.t[i] - entry.corners.t <= SHOWN
            else None
        )
        if (i, seen and seen.t) == self._shown:
            return
        self._shown = i, seen and seen.t
        p = entry.rows(POSITION, i)
        self._ghost.position = self._ellipsoid.position = p + self._scale * (
            entry.rows(EST_POSITION, i) - p
        )
        self._ghost.wxyz = entry.rows(EST_QUATERNION, i)
        covariance = self._scale**2 * entry.rows(COVARIANCE, i).reshape(3, 3)
        self._ellipsoid.scale, self._ellipsoid.wxyz = ellipsoid(covariance)
        self._corners.visible = seen is not None
        if seen:
            crosses = sensed_corners(entry)
            lines = np.zeros((2 * MOST, 2, 3), np.float32)
            lines[: len(crosses)] = crosses[: 2 * MOST]
            self._corners.points = lines


def ellipsoid(covariance: np.ndarray) -> tuple[tuple[float, float, float], np.ndarray]:
    """Its half axes, 3 standard deviations each, and the rotation wxyz (4,) to them.  (3, 3)
    [m^2]"""
    variances, axes = np.linalg.eigh(covariance)
    axes = axes * [1.0, 1.0, np.linalg.det(axes)]  # a rotation, no reflection
    a, b, c = (SIGMAS * np.sqrt(np.maximum(variances, 1e-12))).tolist()
    return (a, b, c), SO3.from_matrix(axes).wxyz


def sensed_corners(entry: Competitor) -> np.ndarray:
    """Crosses across the lines of sight on which corners were found, as far away as the corner each
    is taken for, seen from where the vehicle was when the picture was taken.  (2 corners, 2, 3) [m]
    """
    seen, gates = entry.corners, tuple(dict.fromkeys(entry.course.gates))
    assert seen
    camera = msgspec.convert(entry.spec["sensing"]["camera"], GateCameraConfig)
    i = entry.at(seen.t)
    eye, axes = camera.pose(
        tuple(entry.rows(POSITION, i).tolist()), tuple(entry.rows(QUATERNION, i).tolist())
    )
    local = (seen.pixels - (camera.width / 2, camera.height / 2)) / (camera.fx, camera.fy)
    rays = np.column_stack([local, np.ones(len(local))]) @ axes.T
    known = np.array([gate.corners() for gate in gates])[seen.gates, seen.corners]
    distance = np.linalg.norm(known - eye, axis=1)[:, None]
    at = eye + distance * rays / np.linalg.norm(rays, axis=1)[:, None]
    right, down = ARM * distance * axes[:, 0], ARM * distance * axes[:, 1]
    arms = np.stack([right + down, right - down], axis=1)  # (corners, 2, 3)
    return np.stack([at[:, None] - arms, at[:, None] + arms], axis=2).reshape(-1, 2, 3)
