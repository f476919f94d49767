"""Fit the vehicle's pose to the lines of all gates in a picture.

Some lines do not lie on the edge that was searched for. The lines of all gates together determine
the error of the pose, with the filter's distribution as the prior; lines that contradict the others
get little weight (iteratively reweighted least squares, with the weights of Geman and McClure
1985). A narrower search around the edges that the fitted pose expects then finds the edges
themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from quadsim.rotation import matrix
from quadsim.sensing.camera import BodyPose, Camera
from quadsim.sensing.pixels.edges import EDGES, Points
from quadsim.sensing.state import POSITION, TURN, FilterState

# [px] standard deviation of an end of a line
END_STD = 1.0
# [px] distance from which on a line counts little, in the rounds of the fit
SCALES = (16.0, 8.0, 4.0, 3.0, 3.0)


class Guess(NamedTuple):
    """A pose of the vehicle, and the covariance of its error."""

    pose: BodyPose
    # covariance of the error of the position [m] and of the turn in the body frame [rad]  (6, 6)
    P: np.ndarray
    # variance of each gate's displacement from the map [m^2]  (G,)
    displaced: np.ndarray

    def corrected(self, error: np.ndarray, P: np.ndarray) -> Guess:
        """Return the pose after a correction by an error  (6,), with another covariance."""
        return self._replace(pose=self.pose.corrected(error), P=P)

    def spread(self, J: np.ndarray, gate: np.ndarray) -> np.ndarray:
        """Return the covariance [px^2] of pixels whose Jacobian with respect to the pose is J.

        Args:
            J: Jacobian as in `Seen`, or its part along one direction  (n, k, 6).
            gate: index of each pixel's gate  (n,).

        Returns:
            The covariance  (n, k, k).
        """
        place = J[..., :3]
        loose = self.displaced[gate][:, None, None] * (place @ place.transpose(0, 2, 1))
        return J @ self.P @ J.transpose(0, 2, 1) + loose


def pose_covariance(state: FilterState) -> np.ndarray:
    """Return the covariance of a state's errors of position [m] and rotation [rad].  (6, 6)"""
    block = np.r_[POSITION, TURN]
    return state.P[np.ix_(block, block)]


def guess_of(state: FilterState, gates: int) -> Guess:
    """Return the pose of a filter's state with its covariance.

    Args:
        state: the state of the filter.
        gates: number of gates of the map.
    """
    P = pose_covariance(state)
    # What is beyond the vehicle's own error is the gate's.
    loose = state.gate_std(gates) ** 2 - P.diagonal()[:3].max()
    return Guess(
        BodyPose(np.array(state.nominal.position), matrix(state.nominal.attitude)),
        P,
        np.maximum(loose, 0.0),
    )


def normal_moves(points: Points, camera: Camera, pose: BodyPose) -> np.ndarray:
    """Return the Jacobian of shifts along the normals with respect to the pose.  (n, 1, 6)"""
    return points.normal[:, None] @ camera.seen(points.position, pose).moves


class Fit(NamedTuple):
    """A pose that fits lines."""

    guess: Guess
    # how far the pose moves each end of a line along its normal [px]  (n,)
    moves: np.ndarray


def fitted(guess: Guess, camera: Camera, points: Points, shift: np.ndarray) -> Fit:
    """Return the pose that fits the ends of lines.

    Args:
        guess: the pose before the fit, with its covariance.
        camera: the camera.
        points: the points at the lines' ends.
        shift: distance of each point from its predicted place, along its normal [px]  (n,).
    """
    moves = normal_moves(points, camera, guess.pose)
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
    """Return the indices of the first and the last point of each line.

    Args:
        points: points on the edges.
        used: which points belong to the line of their edge  (n,) bool.
    """
    at = np.flatnonzero(used)
    edge = points.gate[at] * EDGES + points.edge[at]
    order = np.lexsort((points.along[at], edge))
    change = np.diff(edge[order], prepend=-1, append=-1) != 0
    return at[order[change[:-1] | change[1:]]]
