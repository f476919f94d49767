"""Estimates in the scene, for vehicles that fly by sensors.

The estimated pose is a ghost with its 3-sigma ellipsoid; crosses mark the gates' corners at the
places measured by the camera.
"""

from __future__ import annotations

import numpy as np
import viser
from viser.transforms import SO3

from quadsim.course.frames import frames
from quadsim.sensing.measurements import Corners
from quadsim.web.page.scene.drones import SPAN, quadrotor, single_colour
from quadsim.web.race.camera_pictures import camera_of
from quadsim.web.race.competitor import POSITION, QUATERNION, Competitor

# columns of the telemetry
EST_POSITION = tuple(f"est_{name}" for name in POSITION)
EST_QUATERNION = tuple(f"est_{name}" for name in QUATERNION)
COVARIANCE = tuple(f"cov_{axes}" for axes in ("xx", "xy", "xz", "xy", "yy", "yz", "xz", "yz", "zz"))

SENSED = (0, 229, 255)  # colour of measurements and estimates
SIGMAS = 3.0
MOST = 64  # largest number of drawn corners
ARM = 0.02  # half length of a corner's cross, per metre of its distance
SHOWN = 0.25  # duration of the display of corners [s]


class EstimateView:
    """The estimate of one competitor.

    Args:
        name: name of its nodes.
        scale: factor on the sizes of the drone, the error and the ellipsoid; error and ellipsoid at
            true size would be hidden in an enlarged drone.
    """

    def __init__(self, scene: viser.SceneApi, name: str, scale: float):
        self._scale = scale
        self._shown: tuple[int, Corners | None] = (-1, None)
        node = f"/estimate/{name}"
        body = quadrotor(SPAN * scale)["body"]
        colour = single_colour(SENSED)
        self._ghost = scene.add_mesh_simple(
            f"{node}/ghost",
            body.vertices,
            body.faces,
            color=colour,
            opacity=0.35,
            flat_shading=True,
            side="double",
        )
        self._ellipsoid = scene.add_icosphere(
            f"{node}/ellipsoid", 1.0, colour, subdivisions=2, wireframe=True
        )
        self._corners = scene.add_line_segments(
            f"{node}/corners", np.zeros((2 * MOST, 2, 3), np.float32), colour, thickness=0.05
        )

    def show(self, entry: Competitor, i: int) -> None:
        """Show the estimate at frame i, and the corners of the last picture if it is recent."""
        corners = entry.corners
        if corners and not 0.0 <= entry.t[i] - corners.t <= SHOWN:
            corners = None
        if (i, corners) == self._shown:
            return
        self._shown = (i, corners)
        p = entry.rows(POSITION, i)
        estimate = p + self._scale * (entry.rows(EST_POSITION, i) - p)
        self._ghost.position = estimate
        self._ghost.wxyz = entry.rows(EST_QUATERNION, i)
        covariance = self._scale**2 * entry.rows(COVARIANCE, i).reshape(3, 3)
        self._ellipsoid.position = estimate
        self._ellipsoid.scale, self._ellipsoid.wxyz = ellipsoid(covariance)
        self._corners.visible = corners is not None
        if corners:
            crosses = sensed_corners(entry, corners)
            lines = np.zeros((2 * MOST, 2, 3), np.float32)
            lines[: len(crosses)] = crosses[: 2 * MOST]
            self._corners.points = lines


def ellipsoid(covariance: np.ndarray) -> tuple[tuple[float, float, float], np.ndarray]:
    """Return the ellipsoid of three standard deviations.

    Args:
        covariance: covariance of a position [m^2]  (3, 3)

    Returns:
        The half axes [m] (3,), and the rotation wxyz to them (4,).
    """
    variances, axes = np.linalg.eigh(covariance)
    axes = axes * [1.0, 1.0, np.linalg.det(axes)]  # a rotation, no reflection
    a, b, c = (SIGMAS * np.sqrt(np.maximum(variances, 1e-12))).tolist()
    return (a, b, c), SO3.from_matrix(axes).wxyz


def sensed_corners(entry: Competitor, seen: Corners) -> np.ndarray:
    """Return crosses at the corners found by a camera.

    A cross is perpendicular to the measured line of sight from the vehicle at the time of the
    picture, at the distance of the associated corner of the map.

    Returns:
        The lines of the crosses [m]  (2 corners, 2, 3)
    """
    camera = camera_of(entry)
    i = entry.at(seen.t)
    position = tuple(entry.rows(POSITION, i).tolist())
    quaternion = tuple(entry.rows(QUATERNION, i).tolist())
    eye, axes = camera.pose(position, quaternion)
    # lines of sight
    local = (seen.pixels - (camera.width / 2, camera.height / 2)) / (camera.fx, camera.fy)
    rays = np.column_stack([local, np.ones(len(local))]) @ axes.T
    # the corners that they are taken for
    gates = frames(entry.course.gates)
    known = np.array([gate.corners() for gate in gates])[seen.gates, seen.corners]
    distance = np.linalg.norm(known - eye, axis=1)[:, None]
    at = eye + distance * rays / np.linalg.norm(rays, axis=1)[:, None]
    right = ARM * distance * axes[:, 0]
    down = ARM * distance * axes[:, 1]
    arms = np.stack([right + down, right - down], axis=1)  # (corners, 2, 3)
    return np.stack([at[:, None] - arms, at[:, None] + arms], axis=2).reshape(-1, 2, 3)
