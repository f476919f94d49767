"""Updates of the filter by each kind of measurement, with an innovation gate.

A measurement z with the expected value h and the Jacobian H corrects the error by K (z - h), K = P
H^T S^-1, S = H P H^T + R. Its normalised innovation squared (NIS), (z - h)^T S^-1 (z - h), follows
a chi-square distribution if the filter is consistent; a measurement beyond a high quantile of that
distribution is rejected as an outlier.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, sqrt
from typing import NamedTuple

import numpy as np

from quadsim.course import Gate
from quadsim.rotation import between, matrix
from quadsim.sensing.camera import NEAREST, BodyPose
from quadsim.sensing.config import BarometerConfig, CornerCamera, PoseConfig
from quadsim.sensing.measurements import Corners, Height, Pose
from quadsim.sensing.state import DRIFT, POSITION, TURN, VELOCITY, FilterState

# .999 quantiles of chi-square, by its degrees of freedom
GATE = {1: 10.8, 2: 13.8, 3: 16.3}
# joint gate: number of standard deviations sqrt(2 m) above the mean m of chi-square
JOINT = 4.0
# [m] standard deviation below which a gate counts as found; before, a single corner is rejected
FOUND = 0.03
# Lower bounds of the assumed standard deviations of a sensor [m, m/s, rad].
LEAST_POSITION = 1e-3
LEAST_VELOCITY = 1e-2
LEAST_ATTITUDE = 1e-3


@dataclass(frozen=True, slots=True)
class Innovation:
    """The innovation statistics of a measurement: its accepted and its rejected part."""

    # normalised innovation squared of the accepted part
    nis: float
    # degrees of freedom of the accepted part
    used: int
    # degrees of freedom of the rejected part
    refused: int


class Part(NamedTuple):
    """A vector that a pose sensor measures."""

    # rows of the error that this part measures
    rows: slice
    # innovation: measured minus expected  (3,)
    innovation: np.ndarray
    # standard deviation of the noise
    std: float


class PoseUpdate:
    """Uses position, attitude and velocity of a pose sensor, each with its own innovation gate."""

    def __init__(self, config: PoseConfig):
        """Take the noise levels of the sensor, which are known."""
        self._drifts = config.drift > 0.0
        self._position_std = max(config.position_noise, LEAST_POSITION)
        self._velocity_std = max(config.velocity_noise or 0.0, LEAST_VELOCITY)
        self._attitude_std = max(radians(config.attitude_noise_deg), LEAST_ATTITUDE)

    def __call__(self, state: FilterState, pose: Pose) -> tuple[FilterState, Innovation]:
        """Return the state after the update by a pose, and the innovation statistics."""
        parts = self._parts(state, pose)
        H = np.zeros((3 * len(parts), len(state.P)))
        innovation = np.empty(3 * len(parts))
        variance = np.empty(3 * len(parts))
        for k, part in enumerate(parts):
            rows = slice(3 * k, 3 * k + 3)
            H[rows, part.rows] = np.eye(3)
            if self._drifts and part.rows is POSITION:
                H[rows, DRIFT] = np.eye(3)
            innovation[rows] = part.innovation
            variance[rows] = part.std**2
        return corrected(state, H, innovation, variance, group=3)

    def _parts(self, state: FilterState, pose: Pose) -> list[Part]:
        """Return the innovation of each vector of a pose."""
        nominal = state.nominal
        drift = state.drift if self._drifts else np.zeros(3)
        position = np.subtract(pose.position, nominal.position) - drift
        attitude = np.array(between(nominal.attitude, pose.attitude))
        parts = [
            Part(POSITION, position, self._position_std),
            Part(TURN, attitude, self._attitude_std),
        ]
        if pose.velocity:
            velocity = np.subtract(pose.velocity, nominal.velocity)
            parts.append(Part(VELOCITY, velocity, self._velocity_std))
        return parts


class HeightUpdate:
    """Uses heights of a barometer."""

    def __init__(self, config: BarometerConfig):
        """Take the noise of the sensor, which is known; the wash of the rotors is not."""
        self._variance = np.array([max(config.noise, LEAST_POSITION) ** 2])

    def __call__(self, state: FilterState, measured: Height) -> tuple[FilterState, Innovation]:
        """Return the state after the update by a height, and the innovation statistics."""
        H = np.zeros((1, len(state.P)))
        H[0, POSITION] = (0.0, 0.0, 1.0)
        innovation = np.array([measured.height - state.nominal.position[2]])
        return corrected(state, H, innovation, self._variance, group=1)


class CornerUpdate:
    """Uses corners of gates that were found in a picture, each with its own innovation gate.

    The standard deviation of a pixel comes from its noise and, to second order, from the
    projection's curvature under the state's uncertainty: about focal (tr P_theta + tr P_p / z^2).
    The second part matters until the heading has converged.
    """

    def __init__(self, config: CornerCamera, gates: Sequence[Gate], free: bool):
        """Take the camera and the map.

        Args:
            config: the camera.
            gates: gates of the map, each once.
            free: whether displacements of gates from the map are states of the filter.
        """
        self._config = config
        self._free = free
        self._map = np.array([gate.corners() for gate in gates])  # (gates, 4, 3)

    def __call__(self, state: FilterState, found: Corners) -> tuple[FilterState, Innovation]:
        """Return the state after the update by the corners of a picture, and its statistics."""
        camera = self._config

        # Where the corners of the map are expected in the picture.
        points = self._map[found.gates, found.corners]
        if self._free:
            points = points + state.gates[found.gates]
        pose = BodyPose(np.array(state.nominal.position), matrix(state.nominal.attitude))
        expected = camera.seen(points, pose)

        # Corners behind the camera are outliers; unconfirmed corners are left out.
        ahead = np.flatnonzero((expected.depth > NEAREST) & self._confirmed(state, found.gates))
        left_out = 2 * (len(points) - len(ahead))
        if not len(ahead):
            return state, Innovation(0.0, 0, left_out)

        H = self._jacobian(state, expected.moves[ahead], found.gates[ahead])
        innovation = (found.pixels[ahead] - expected.pixels[ahead]).ravel()
        depth = expected.depth[ahead]
        turns = np.trace(state.P[TURN, TURN])
        moves = np.trace(state.P[POSITION, POSITION])
        curved = camera.fx * (turns + moves / depth**2)  # (n,)
        variance = np.repeat(camera.noise**2 + curved**2, 2)
        if found.variance is not None:
            variance += np.repeat(found.variance[ahead], 2)
        after, taken = corrected(state, H, innovation, variance, group=2)
        return after, Innovation(taken.nis, taken.used, taken.refused + left_out)

    def _confirmed(self, state: FilterState, gates: np.ndarray) -> np.ndarray:
        """Return which corners are confirmed.  (n,) bool

        A corner is confirmed if its gate's position has converged, or if the picture has a second
        corner of that gate. A gate that may stand anywhere within 15 cm accepts a wrongly matched
        corner; its estimate would move there, and its own corners would be rejected from then on.
        """
        if not self._free:
            return np.ones(len(gates), bool)
        variance = np.diag(state.P)[state.first_gate :].reshape(-1, 3).max(axis=1)
        return (variance[gates] < FOUND**2) | (np.bincount(gates)[gates] > 1)

    def _jacobian(self, state: FilterState, moves: np.ndarray, gates: np.ndarray) -> np.ndarray:
        """Return the Jacobian of the pixels with respect to the error state.

        A displacement of the gate changes the pixels by the opposite of the same displacement of
        the vehicle.

        Args:
            state: the state of the filter.
            moves: of each corner by the error of the pose, see `Seen`  (n, 2, 6).
            gates: index of each corner's gate  (n,).

        Returns:
            (2 n, states)
        """
        n = len(moves)
        H = np.zeros((n, 2, len(state.P)))
        H[:, :, POSITION] = moves[:, :, :3]
        H[:, :, TURN] = moves[:, :, 3:]
        if self._free:
            first = state.first_gate + 3 * gates
            for k in range(3):
                H[np.arange(n), :, first + k] = -moves[:, :, k]
        return H.reshape(2 * n, -1)


def corrected(
    state: FilterState, H: np.ndarray, innovation: np.ndarray, variance: np.ndarray, group: int
) -> tuple[FilterState, Innovation]:
    """Return the state after a measurement, and the innovation statistics.

    Each group of rows has its own innovation gate; then the accepted groups share a joint gate:
    while their NIS is beyond JOINT standard deviations, the group with the worst fit after the
    correction is rejected. The joint gate is needed if the state is uncertain, as every single
    group passes its own gate then.

    Args:
        state: before the measurement.
        H: Jacobian with respect to the error  (m, n).
        innovation: measured minus expected  (m,).
        variance: variance of the measurement's noise  (m,).
        group: number of rows that are accepted or rejected together.
    """
    z = innovation
    R = variance
    PHt = state.P @ H.T  # (n, m)
    S = H @ PHt
    S.flat[:: len(S) + 1] += R

    # Gate each group by itself.
    number = np.arange(len(z) // group)
    each = z.reshape(-1, group)
    blocks = S.reshape(len(number), group, len(number), group)[number, :, number, :]
    nis = (each * np.linalg.solve(blocks, each[:, :, None])[:, :, 0]).sum(axis=1)
    good = nis < GATE[group]

    # Gate the accepted groups jointly.
    while good.any():
        rows = np.flatnonzero(np.repeat(good, group))
        part = PHt[:, rows]
        # S^-1 [H P, z]
        solved = np.linalg.solve(S[np.ix_(rows, rows)], np.column_stack([part.T, z[rows]]))
        dx = part @ solved[:, -1]
        total = float(z[rows] @ solved[:, -1])
        m = len(rows)
        if total < m + JOINT * sqrt(2.0 * m) or m == group:
            P = state.P - part @ solved[:, :-1]
            refused = group * int((~good).sum())
            return state.corrected(dx, 0.5 * (P + P.T)), Innovation(total, m, refused)

        # Reject the group with the worst fit after the correction.
        residual = (((z - H @ dx) ** 2 / R).reshape(-1, group)).sum(axis=1)
        good[np.argmax(np.where(good, residual, -1.0))] = False
    return state, Innovation(0.0, 0, len(z))
