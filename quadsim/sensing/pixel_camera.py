"""The pixel camera, which renders pictures of a flight with motion blur and rolling shutter.

Row v of a picture of height H, whose middle is taken at t, is exposed around

    t + readout ((v + 1/2) / H - 1/2)

for `exposure` seconds: a rolling shutter, global if `readout` is 0. A picture is the mean of n
passes, which blurs it by the motion: the exposure is divided into n equal parts, and pass k has the
pose in the middle of part k.
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
    """A function that renders the pictures of a flight."""

    def __call__(self, eyes: np.ndarray, axes: np.ndarray) -> np.ndarray:
        """Return a picture.

        Args:
            eyes: position of the camera for each pass and row [m]  (passes, height, 3).
            axes: rotation from camera to world axes for each pass and row  (passes, height, 3, 3).

        Returns:
            The picture  (height, width, 3) uint8.
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
        """Make a camera whose pictures are rendered by `eye`.

        Args:
            config: the camera.
            eye: function that renders the pictures.
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
        """Return a picture if one is completed by this step and not lost, else None."""
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
    """Return the instant [s] of each pass and row of a picture.  (passes, height)"""
    rows = (np.arange(config.height) + 0.5) / config.height - 0.5
    parts = (np.arange(config.passes) + 0.5) / config.passes - 0.5
    return t + config.readout * rows + config.exposure * parts[:, None]


def row_poses(
    config: PixelCameraConfig, t: float, moments: list[TimedPose]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pose of the camera for each pass and row of a picture.

    Between two instants position and quaternion are interpolated; before the first and after the
    last they are constant.

    Args:
        config: the camera.
        t: middle of the picture [s].
        moments: poses of the vehicle in order of time.

    Returns:
        The position [m]  (passes, height, 3), and the rotation from camera to world axes  (passes,
        height, 3, 3).
    """
    times = np.array([moment.t for moment in moments])
    poses = np.array([moment.pose for moment in moments])
    poses[:, 3:] = without_jumps(poses[:, 3:])
    wanted = row_times(config, t)
    found = np.stack([np.interp(wanted, times, column) for column in poses.T], axis=-1)
    return camera_poses(config, found[..., :3], found[..., 3:])


def camera_poses(camera: Camera, p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the camera's poses, as `Camera.pose` does, for many poses of its vehicle.

    Args:
        camera: the camera.
        p: position of the vehicle [m]  (..., 3).
        q: attitude of the vehicle, wxyz, normalised here  (..., 4).

    Returns:
        The position [m]  (..., 3), and the rotation from camera to world axes  (..., 3, 3).
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
