"""The pixel camera: pictures of a flight, drawn over the time for which the shutter is open.

Row v of a picture of height H, whose middle is taken at t, is exposed around

    t + readout ((v + 1/2) / H - 1/2)

for `exposure` seconds: a rolling shutter, global if `readout` is 0. Pass k of n has the pose of the
middle of the k-th of n equal parts of that time, so that their mean is blurred by the motion.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple, Protocol

import numpy as np

from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.rotation import without_jumps
from quadsim.sensing.camera import Camera
from quadsim.sensing.config import PixelCameraConfig
from quadsim.sensing.dropouts import Dropouts
from quadsim.sensing.measurements import Photo
from quadsim.sensing.timing import Ticks

# [s] Instants that differ by less count as equal.
ROUNDING = 1e-9


class Eye(Protocol):
    """A function that draws the pictures of a flight."""

    def __call__(self, eyes: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Return a picture.

        Args:
            eyes: position of the camera by pass and row [m]  (passes, height, 3).
            axes: rotation world from camera by pass and row  (passes, height, 3, 3).

        Returns:
            (height, width, 3) uint8
        """
        ...


class TimedPose(NamedTuple):
    """The pose of the vehicle at one instant."""

    # [s]
    t: float
    # position [m] and attitude, wxyz
    pose: tuple[float, ...]


class PixelCamera:
    """Takes pictures of a flight."""

    def __init__(self, config: PixelCameraConfig, eye: Eye, seeds: np.random.SeedSequence):
        """Take pictures with an eye.

        Args:
            config: the camera.
            eye: what draws the pictures.
            seeds: random stream of the dropouts.
        """
        self.latency = config.latency
        self._config = config
        self._eye = eye
        self._ticks = Ticks(config.rate)
        self._half = 0.5 * (config.exposure + config.readout)
        self._dropouts = Dropouts(config.dropouts, config.dropout, seeds)
        # recent poses of the vehicle, and the middles of the pictures that are being taken
        self._moments: deque[TimedPose] = deque()
        self._open: deque[float] = deque()

    def sample(self, state: PlantState[State]) -> Photo | None:
        """Return a picture if one is complete at this step and not lost, else None."""
        x = state.x
        self._moments.append(TimedPose(state.t, (*x.position, *x.attitude)))
        if self._ticks.due(state.t):
            self._open.append(state.t)
        oldest = (self._open[0] if self._open else state.t) - self._half
        while len(self._moments) > 1 and self._moments[1].t <= oldest:
            self._moments.popleft()
        if not self._open or state.t < self._open[0] + self._half - ROUNDING:
            return None
        t = self._open.popleft()
        if self._dropouts.lost(t):
            return None
        eyes, axes = row_poses(self._config, t, list(self._moments))
        return Photo(t, self._eye(eyes, axes))


def row_times(config: PixelCameraConfig, t: float) -> np.ndarray:
    """Return the instant of each row of each pass of a picture [s].  (passes, height)"""
    rows = (np.arange(config.height) + 0.5) / config.height - 0.5
    parts = (np.arange(config.passes) + 0.5) / config.passes - 0.5
    return t + config.readout * rows + config.exposure * parts[:, None]


def row_poses(
    config: PixelCameraConfig, t: float, moments: list[TimedPose]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pose of the camera at each row of each pass of a picture.

    Between two instants position and quaternion are interpolated; before the first and after the
    last they are constant.

    Args:
        config: the camera.
        t: middle of the picture [s].
        moments: poses of the vehicle in order of time.

    Returns:
        The position [m]  (passes, height, 3), and the rotation world from camera
        (passes, height, 3, 3).
    """
    times = np.array([moment.t for moment in moments])
    poses = np.array([moment.pose for moment in moments])
    poses[:, 3:] = without_jumps(poses[:, 3:])
    wanted = row_times(config, t)
    found = np.stack([np.interp(wanted, times, column) for column in poses.T], axis=-1)
    return camera_poses(config, found[..., :3], found[..., 3:])


def camera_poses(camera: Camera, p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return `Camera.pose` of many poses of a vehicle.

    Args:
        camera: the camera.
        p: position of the vehicle [m]  (..., 3).
        q: attitude of the vehicle, wxyz, of any length but zero  (..., 4).

    Returns:
        The position [m]  (..., 3), and the rotation world from camera  (..., 3, 3).
    """
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    body = np.empty((*q.shape[:-1], 3, 3))
    body[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    body[..., 0, 1] = 2.0 * (x * y - w * z)
    body[..., 0, 2] = 2.0 * (x * z + w * y)
    body[..., 1, 0] = 2.0 * (x * y + w * z)
    body[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    body[..., 1, 2] = 2.0 * (y * z - w * x)
    body[..., 2, 0] = 2.0 * (x * z - w * y)
    body[..., 2, 1] = 2.0 * (y * z + w * x)
    body[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return p + body @ np.asarray(camera.position), body @ camera.axes
