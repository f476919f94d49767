"""The pose that fits the lines of all gates in a picture.

Some lines lie on something else than the edge that was searched for. The lines of all gates
together tell the error of the pose, within what the filter takes for possible; lines that
contradict the others count little (iteratively reweighted least squares, with the weights of Geman
and McClure 1985). A narrower search around the edges that the fitted pose expects then finds the
edges themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.rotation import exp, matrix
from quadsim.sensing.camera import Camera
from quadsim.sensing.estimation.error_state import POSITION, TURN, FilterState
from quadsim.sensing.pixels.edges import EDGES, Points, View

# [m]
NEAREST = 0.2
# [px] standard deviation of an end of a line
END_STD = 1.0
# [px] distance from which on a line counts little, in the rounds of the fit
SCALES = (16.0, 8.0, 4.0, 3.0, 3.0)


class Guess(NamedTuple):
    """A pose of the vehicle, and what is known of its error."""

    # [m]  (3,)
    position: np.ndarray
    # world from body  (3, 3)
    body: np.ndarray
    # covariance of the error of the position [m] and of the turn in the body frame [rad]  (6, 6)
    P: np.ndarray
    # variance of each gate's displacement from the map [m^2]  (G,)
    displaced: np.ndarray

    def view(self, camera: Camera) -> View:
        """Return the pose of the camera."""
        return View(
            self.position + self.body @ np.asarray(camera.position), self.body @ camera.axes
        )

    def corrected(self, error: np.ndarray, P: np.ndarray) -> Guess:
        """Return the pose after a correction by an error  (6,), with another covariance."""
        turned = self.body @ matrix(exp(error[3:].tolist()))
        return self._replace(position=self.position + error[:3], body=turned, P=P)

    def spread(self, J: np.ndarray, gate: np.ndarray) -> np.ndarray:
        """Return the covariance of pixels that move by J with the error of the pose [px^2].

        Args:
            J: by `pixel_moves`, or along one direction, (n, k, 6).
            gate: of each pixel  (n,).

        Returns:
            (n, k, k)
        """
        place = J[..., :3]
        loose = self.displaced[gate][:, None, None] * (place @ place.transpose(0, 2, 1))
        return J @ self.P @ J.transpose(0, 2, 1) + loose


def guess_of(state: FilterState, gates: int) -> Guess:
    """Return the pose of a filter's state with its covariance.

    Args:
        state: the state of the filter.
        gates: number of gates of the map.
    """
    block = np.r_[POSITION, TURN]
    P = state.P[np.ix_(block, block)]
    # What is beyond the vehicle's own error is the gate's.
    loose = state.gate_std(gates) ** 2 - P.diagonal()[:3].max()
    return Guess(
        np.array(state.nominal.position),
        matrix(state.nominal.attitude),
        P,
        np.maximum(loose, 0.0),
    )


def pixel_moves(points: np.ndarray, camera: Camera, guess: Guess) -> np.ndarray:
    """Return how pixels of points move with the error of a pose.

    Args:
        points: in the world [m]; what is nearer than NEAREST along the optical axis counts as there
            (n, 3).
        camera: the camera.
        guess: the pose.

    Returns:
        [px/m] for the position, [px/rad] for the turn  (n, 2, 6)
    """
    away = (points - guess.position) @ guess.body
    x, y, z = ((away - np.asarray(camera.position)) @ camera.axes).T
    z = np.maximum(z, NEAREST)
    by_place = np.zeros((len(points), 2, 3))
    by_place[:, 0, 0] = camera.fx / z
    by_place[:, 1, 1] = camera.fy / z
    by_place[:, 0, 2] = -camera.fx * x / z**2
    by_place[:, 1, 2] = -camera.fy * y / z**2
    by_body = by_place @ camera.axes.T
    # The body frame turns by t: a point at b in it moves to b + b x t.
    return np.concatenate([-by_body @ guess.body.T, np.cross(by_body, away[:, None])], axis=2)


def normal_moves(points: Points, camera: Camera, guess: Guess) -> np.ndarray:
    """Return `pixel_moves` along the normals of points on edges.  (n, 1, 6)"""
    return points.normal[:, None] @ pixel_moves(points.position, camera, guess)


class Fit(NamedTuple):
    """A pose that fits lines."""

    guess: Guess
    # how far the pose moves each end of a line along its normal [px]  (n,)
    moves: np.ndarray


def fitted(guess: Guess, camera: Camera, points: Points, shift: np.ndarray) -> Fit:
    """Return the pose that fits the ends of lines.

    Args:
        guess: the pose before.
        camera: the camera.
        points: the points at the lines' ends.
        shift: how far each is from where it is expected, along its normal [px]  (n,).
    """
    moves = normal_moves(points, camera, guess)
    J = moves[:, 0]
    loose = guess._replace(P=np.zeros((6, 6))).spread(moves, points.gate)[:, 0, 0]
    before = np.linalg.inv(guess.P + 1e-12 * np.eye(6))
    error = np.zeros(6)
    after = guess.P
    for scale in SCALES:
        off = shift - J @ error
        weight = 1.0 / (1.0 + (off / scale) ** 2) ** 2 / (END_STD**2 + loose)
        after = np.linalg.inv(before + (J.T * weight) @ J)
        error = after @ (J.T @ (weight * shift))
    return Fit(guess.corrected(error, after), J @ error)


def line_ends(points: Points, used: np.ndarray) -> np.ndarray:
    """Return the indices of the first and of the last point of each line.

    used: which points belong to the line of their edge  (n,).
    """
    at = np.flatnonzero(used)
    edge = points.gate[at] * EDGES + points.edge[at]
    order = np.lexsort((points.along[at], edge))
    change = np.diff(edge[order], prepend=-1, append=-1) != 0
    return at[order[change[:-1] | change[1:]]]
