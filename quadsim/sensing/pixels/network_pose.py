"""Find the pose that explains a network's gates best, among poses that the filter allows.

Each found gate may be any gate of the map. For each pair of a found gate and a gate of the map,
corners are matched by their directions from the centre, because the filter knows the attitude well
enough. The filter's innovation test rejects impossible pairs, and a pose is fitted to every other
pair. The pose that explains most of the other corners is chosen, as in RANSAC (Fischler and Bolles
1981), and fitted to all of these.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np

from quadsim.sensing.camera import NEAREST, BodyPose
from quadsim.sensing.config import CornerCamera
from quadsim.sensing.pixels.edges import Frames
from quadsim.sensing.pixels.network import FoundGate

# [px] standard deviation of a corner that a network has found
NOISE = 2.5
# [px] A pose explains a corner within this distance of its predicted pixel.
NEAR = 8.0
# least cosine of the angle between the found and the expected direction of a corner
ALIKE = 0.7
# largest normalised innovation squared of a pair, by its degrees of freedom
POSSIBLE = {4: 24.0, 6: 28.0, 8: 32.0}
# fewest corners that a pose has to explain
FEWEST = 3
# steps of the Gauss-Newton method
STEPS = 4


class Matched(NamedTuple):
    """Found corners, matched with corners of the map."""

    gate: np.ndarray
    corner: np.ndarray
    # [px]  (n, 2)
    pixel: np.ndarray


class Explained(NamedTuple):
    """A pose, and the found corners that it explains."""

    # of the pose: position [m], turn in the body frame [rad]  (6,)
    error: np.ndarray
    matched: Matched


class Place:
    """The filter's pose, and the corners of the map as this pose predicts them in the picture."""

    def __init__(
        self,
        frames: Frames,
        camera: CornerCamera,
        pose: BodyPose,
        P: np.ndarray,
        late: np.ndarray,
    ):
        """Predict the corners of the map.

        Args:
            frames: the frames of the map.
            camera: the camera.
            pose: estimated pose of the vehicle.
            P: covariance of the errors of position and rotation  (6, 6).
            late: movement of each corner until its row is exposed [px]  (gates, 4, 2).
        """
        self._frames = frames
        self._camera = camera
        self._pose = pose
        self.late = late.reshape(-1, 4, 2)
        self._late = late.reshape(-1, 2)
        self._points = frames.corners.reshape(-1, 3)
        self.P = P
        self._information = np.linalg.inv(P + 1e-12 * np.eye(6))

    def pixels(self, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the pixels and depths of all corners after a correction of the pose.

        Args:
            error: correction of position [m] and rotation [rad]  (6,).

        Returns:
            Pixels, nan for corners behind the camera  (gates, 4, 2), and depths [m]  (gates, 4).
        """
        pixels, depth, _ = self._camera.seen(self._points, self._pose.corrected(error))
        pixels = np.where(depth[:, None] > NEAREST, pixels + self._late, np.nan)
        return pixels.reshape(-1, 4, 2), depth.reshape(-1, 4)

    def linear(self, error: np.ndarray, matched: Matched) -> tuple[np.ndarray, np.ndarray]:
        """Return the innovation of corners, and its Jacobian with respect to the pose's error.

        Args:
            error: correction of position [m] and rotation [rad], at which it is linearised  (6,).
            matched: found corners with corners of the map.

        Returns:
            The innovation [px]  (2 n,) and the Jacobian  (2 n, 6)."""
        index = 4 * matched.gate + matched.corner
        seen = self._camera.seen(self._points[index], self._pose.corrected(error))
        innovation = matched.pixel - seen.pixels - self._late[index]
        return innovation.ravel(), seen.moves.reshape(-1, 6)

    def fit(self, matched: Matched) -> np.ndarray:
        """Return the most likely error of the pose, given corners and the filter's covariance.

        Returns:
            Errors of position [m] and rotation [rad]  (6,).
        """
        error = np.zeros(6)
        for _ in range(STEPS):
            innovation, H = self.linear(error, matched)
            # Far corners count less (Huber 1964).
            size = np.linalg.norm(innovation.reshape(-1, 2), axis=1)
            weight = np.repeat(np.minimum(1.0, 2.0 * NOISE / np.maximum(size, 1e-9)), 2) / NOISE**2
            A = H.T @ (weight[:, None] * H) + self._information
            b = H.T @ (weight * innovation) - self._information @ error
            error = error + np.linalg.solve(A, b)
        return error

    def possible(self, matched: Matched) -> bool:
        """Return whether matched corners pass the filter's innovation test."""
        innovation, H = self.linear(np.zeros(6), matched)
        depth = self._depth(matched)
        turns = np.trace(self.P[3:, 3:])
        moves = np.trace(self.P[:3, :3])
        # The projection is not linear in a large error, see CornerUpdate.
        curved = self._camera.fx * (turns + moves / depth**2)
        S = H @ self.P @ H.T + np.diag(np.repeat(NOISE**2 + curved**2, 2))
        nis = innovation @ np.linalg.solve(S, innovation)
        return bool(nis < POSSIBLE[len(innovation)])

    def _depth(self, matched: Matched) -> np.ndarray:
        """Return the depth of corners at the filter's pose [m], at least NEAREST.  (n,)"""
        seen = self._camera.seen(self._points[4 * matched.gate + matched.corner], self._pose)
        return np.maximum(seen.depth, NEAREST)


def explained(found: Sequence[FoundGate], place: Place) -> Explained | None:
    """Return the pose that explains found gates best; None if there is none.

    Args:
        found: gates that a network has found in a picture.
        place: the filter's pose.
    """
    best: Explained | None = None
    best_score = (0, 0.0)
    for pair in _pairs(found, place):
        if not place.possible(pair):
            continue
        error = place.fit(pair)
        matched = all_matched(found, *place.pixels(error))
        if len(matched.gate) < FEWEST:
            continue
        surprise = float(error @ np.linalg.solve(place.P + 1e-12 * np.eye(6), error))
        score = (len(matched.gate), -surprise)
        if score > best_score:
            best_score = score
            best = Explained(error, matched)
    if best is None:
        return None
    error = place.fit(best.matched)
    return Explained(error, all_matched(found, *place.pixels(error)))


def _pairs(found: Sequence[FoundGate], place: Place) -> Iterator[Matched]:
    """Yield each found gate's corners, matched with each gate of the map in front of the camera."""
    expected, _ = place.pixels(np.zeros(6))
    ahead = ~np.isnan(expected).any(axis=(1, 2))
    for one in found:
        if len(one.corners) < 2:
            continue
        seen = _directions(one.corners - one.centre)
        for gate in np.flatnonzero(ahead).tolist():
            corners = expected[gate]
            alike = seen @ _directions(corners - corners.mean(axis=0)).T  # (n, 4)
            order = max(
                permutations(range(4), len(seen)),
                key=lambda order: sum(alike[k, c] for k, c in enumerate(order)),
            )
            if min(alike[k, c] for k, c in enumerate(order)) < ALIKE:
                continue
            yield Matched(np.full(len(order), gate), np.array(order), one.corners)


def all_matched(
    found: Sequence[FoundGate], expected: np.ndarray, depth: np.ndarray, near: float = NEAR
) -> Matched:
    """Return the found corners that a pose explains, each corner of the map at most once.

    Args:
        found: gates that a network has found in a picture.
        expected: pixels of the corners as the pose predicts them, nan behind the camera
            (gates, 4, 2).
        depth: depth of the corners [m]  (gates, 4).
        near: largest distance of a corner from its predicted pixel [px].
    """
    pixels = np.concatenate([one.corners for one in found]) if found else np.zeros((0, 2))
    towards = np.concatenate([one.centre - one.corners for one in found]) if found else pixels
    centres = expected.mean(axis=1, keepdims=True) - expected  # (gates, 4, 2)
    flat = expected.reshape(-1, 2)
    apart = np.linalg.norm(pixels[:, None] - flat, axis=2)  # (n, 4 gates)
    alike = (_directions(towards) @ _directions(centres.reshape(-1, 2)).T) > ALIKE
    apart = np.where(alike & (depth.ravel() > NEAREST), apart, np.inf)
    gates, corners, rows = [], [], []
    # The nearest pairs first.
    while apart.size and np.nanmin(apart) < near:
        k, index = np.unravel_index(np.nanargmin(apart), apart.shape)
        gates.append(index // 4)
        corners.append(index % 4)
        rows.append(k)
        apart[k] = np.inf
        apart[:, index] = np.inf
    return Matched(np.array(gates, int), np.array(corners, int), pixels[rows].reshape(-1, 2))


def _directions(vectors: np.ndarray) -> np.ndarray:
    """Return vectors scaled to length 1.  (n, 2)"""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)
