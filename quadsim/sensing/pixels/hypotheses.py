"""Find the pose that explains a picture best, among poses from the filter's distribution.

Poses are drawn from the filter's normal distribution. A pose is good if the picture has the gates'
colour where the pose projects the middle of a frame's bars, and lacks it beside the bars. A
narrower distribution is centred on the best poses, and this is repeated: the cross-entropy method
(Rubinstein and Kroese 2004).
"""

from __future__ import annotations

import numpy as np

from quadsim.sensing.camera import NEAREST, BodyPose
from quadsim.sensing.config import CornerCamera
from quadsim.sensing.pixels.edges import SIDES, Frames
from quadsim.sensing.pixels.signal import sampled

# poses of each round, the best of them that make the next one, and rounds
POSES = 256
BEST = 12
ROUNDS = 4
# points on a bar
ON_BAR = 5
# [px] width over which the signal is averaged in each round
WIDTHS = (9, 5, 3, 3)


def best_pose(
    signal: np.ndarray,
    frames: Frames,
    camera: CornerCamera,
    pose: BodyPose,
    P: np.ndarray,
) -> np.ndarray:
    """Return the most likely error of a pose, position [m] and body rotation [rad].  (6,)

    Args:
        signal: weight of the gates' colour in each pixel  (height, width).
        frames: the frames of the map.
        camera: the camera.
        pose: estimated pose of the vehicle.
        P: covariance of the errors of position and rotation  (6, 6).
    """
    # imported here, as it takes a while
    from scipy.ndimage import uniform_filter

    normal = _normals()
    centre = np.zeros(6)
    factor = np.linalg.cholesky(P + 1e-12 * np.eye(6))
    bars, beside = _pattern(frames)
    for round_, width in zip(range(ROUNDS), WIDTHS, strict=True):
        smooth = uniform_filter(signal, width)
        errors = centre + normal @ factor.T
        # The distribution's own centre is among them.
        errors[0] = centre
        scores = _scores(smooth, bars, beside, camera, pose, errors)
        best = errors[np.argsort(-scores, kind="stable")[:BEST]]
        centre = best[0] if round_ == ROUNDS - 1 else best.mean(axis=0)
        spread = np.cov(best.T) + 1e-8 * np.eye(6)
        factor = np.linalg.cholesky(spread)
    return centre


def _normals() -> np.ndarray:
    """Return evenly spread points of the standard normal distribution.  (POSES, 6)"""
    # imported here, as they take a while
    from scipy.special import ndtri
    from scipy.stats import qmc

    points = qmc.Sobol(6, scramble=False).random(POSES)
    return ndtri(np.clip(points, 1e-6, 1.0 - 1e-6))


def _pattern(frames: Frames) -> tuple[np.ndarray, np.ndarray]:
    """Return points in the middle of the bars, and points beside them, in the world [m].

    Returns:
        Points on the bars  (n, 3), and for each of them one point within the opening and one
        outside the frame  (n, 2, 3).
    """
    along = np.linspace(-0.9, 0.9, ON_BAR)
    middle = 0.5 * (frames.inner + frames.outer)
    width = frames.outer - frames.inner
    on = []
    off = []
    for axis, sign in SIDES:
        for share in along:
            rows = []
            for distance in (0.0, -1.0, 1.0):
                point = np.zeros((len(frames.centre), 3))
                point[:, 1 + axis] = sign * (middle[:, axis] + distance * width[:, axis])
                point[:, 2 - axis] = share * middle[:, 1 - axis]
                rows.append(frames.world(point[:, None])[:, 0])
            on.append(rows[0])
            off.append(np.stack(rows[1:], axis=1))
    return np.concatenate(on), np.concatenate(off)


def _scores(
    signal: np.ndarray,
    bars: np.ndarray,
    beside: np.ndarray,
    camera: CornerCamera,
    pose: BodyPose,
    errors: np.ndarray,
) -> np.ndarray:
    """Return a score for each pose, which is higher if it explains the picture better.  (n,)"""
    near = np.linalg.norm(bars - pose.position, axis=1) < camera.range
    points = np.concatenate([bars[near, None], beside[near]], axis=1)  # (m, 3, 3)
    turned = pose.body @ _turns(errors[:, 3:])  # (n, 3, 3)
    away = points.reshape(-1, 3) - pose.position - errors[:, None, :3]  # (n, 3 m, 3)
    local = (away @ turned - np.asarray(camera.position)) @ camera.axes
    flat = local.reshape(-1, 3)
    pixels, depth = camera.to_pixels(flat)
    inside = camera.in_picture(pixels) & (depth > NEAREST)
    values = np.zeros(len(flat), np.float32)
    values[inside] = np.maximum(sampled(signal, pixels[inside]), 0.0)
    values = values.reshape(len(errors), -1, 3)
    seen = inside.reshape(len(errors), -1, 3)[:, :, 0]
    contrast = values[..., 0] - 0.5 * (values[..., 1] + values[..., 2])
    return np.where(seen, contrast, 0.0).sum(axis=1)


def _turns(turns: np.ndarray) -> np.ndarray:
    """Return the matrices of rotation vectors [rad] by Rodrigues' formula.  (n, 3) -> (n, 3, 3)"""
    angle = np.linalg.norm(turns, axis=1)[:, None, None]
    safe = np.maximum(angle, 1e-12)
    x, y, z = (turns / safe[:, 0]).T
    zero = np.zeros_like(x)
    K = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)
