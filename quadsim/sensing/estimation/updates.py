"""Updates of the filter: what each kind of measurement says of the error, with gating of what cannot be true.

A measurement z with the expected value h and the Jacobian H corrects the error by K (z - h), K = P H^T S^-1,
S = H P H^T + R. Its normalised innovation squared (NIS), (z - h)^T S^-1 (z - h), follows a chi-square law if the filter
is consistent; a measurement beyond a high quantile of it is taken for an outlier and left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians, sqrt

import numpy as np

from quadsim.course import Gate
from quadsim.sensing.attitude import between, matrix
from quadsim.sensing.camera_model import NEAREST, GateCameraConfig
from quadsim.sensing.config import PoseConfig
from quadsim.sensing.estimation.error_state import MOVING, POSITION, TURN, VELOCITY, Belief
from quadsim.sensing.measurements import Corners, Pose

GATE = {2: 13.8, 3: 16.3}  # .999 quantiles of chi-square with 2 and 3 degrees of freedom
JOINT = 4.0  # standard deviations of chi-square, sqrt(2 m), above its mean m
FOUND = 0.03  # [m] standard deviation from which on a gate counts as found; until then a lone corner is no evidence
LEAST = {"position": 1e-3, "velocity": 1e-2, "attitude": 1e-3}  # [m, m/s, rad] a sensor is never taken for better


@dataclass(frozen=True, slots=True)
class Innovation:
    """How a measurement was taken."""

    nis: float  # of what was used
    used: int  # degrees of freedom of what was used
    refused: int  # of what was taken for outliers


class PoseUpdate:
    """Position, attitude and velocity of a pose sensor, each gated by itself."""

    def __init__(self, config: PoseConfig):
        self._drifts = config.drift > 0.0
        self._std = {
            "position": max(config.position_noise, LEAST["position"]),
            "velocity": max(config.velocity_noise or 0.0, LEAST["velocity"]),
            "attitude": max(radians(config.attitude_noise_deg), LEAST["attitude"]),
        }

    def __call__(self, belief: Belief, said: Pose) -> tuple[Belief, Innovation]:
        n, std, total = belief.nominal, self._std, []
        drift = belief.drift if self._drifts else np.zeros(3)
        parts = [("position", POSITION, np.subtract(said.position, n.p) - drift)]
        parts.append(("attitude", TURN, np.array(between(n.q, said.attitude))))
        if said.velocity:
            parts.append(("velocity", VELOCITY, np.subtract(said.velocity, n.v)))
        H, z, R = np.zeros((3 * len(parts), len(belief.P))), np.empty(3 * len(parts)), np.empty(3 * len(parts))
        for k, (name, where, innovation) in enumerate(parts):
            rows = slice(3 * k, 3 * k + 3)
            H[rows, where] = np.eye(3)
            if name == "position" and self._drifts:
                H[rows, MOVING : MOVING + 3] = np.eye(3)
            z[rows], R[rows] = innovation, std[name] ** 2
            total.append(rows)
        return corrected(belief, H, z, R, 3)


class CornerUpdate:
    """Corners of gates that were found in a picture, each gated by itself.

    The variance of a pixel is that of its noise, and what the projection's curvature makes of the state's own
    uncertainty: about focal (tr P_theta + tr P_p / z^2), to second order. It matters until the heading is known.
    """

    def __init__(self, config: GateCameraConfig, gates: Sequence[Gate], free: bool):
        """gates: of the map, each once. free: whether they may stand elsewhere, as states of the filter."""
        self._config, self._free, self._rotation = config, free, config.axes.T
        self._map = np.array([gate.corners() for gate in gates])  # (gates, 4, 3)

    def __call__(self, belief: Belief, said: Corners) -> tuple[Belief, Innovation]:
        R = matrix(belief.nominal.q)
        points = self._map[said.gates, said.corners]
        if self._free:
            points = points + belief.gates[said.gates]
        body = (points - belief.nominal.p) @ R  # (n, 3)
        x, y, z = camera = self._config.local(body).T
        ahead = np.flatnonzero((z > NEAREST) & self._confirmed(belief, said.gates))
        if not len(ahead):
            return belief, Innovation(0.0, 0, 2 * len(points))
        (x, y, z), body, c = camera[:, ahead], body[ahead], self._config
        pixels, _ = c.to_pixels(np.column_stack([x, y, z]))
        H = self._jacobian(belief, R, body, x, y, z, said.gates[ahead])
        innovation = (said.pixels[ahead] - pixels).ravel()
        curved = c.fx * (np.trace(belief.P[TURN, TURN]) + np.trace(belief.P[POSITION, POSITION]) / z**2)  # (n,)
        new, found = corrected(belief, H, innovation, np.repeat(c.noise**2 + curved**2, 2), 2)
        return new, Innovation(found.nis, found.used, found.refused + 2 * (len(points) - len(ahead)))

    def _confirmed(self, belief: Belief, gates: np.ndarray) -> np.ndarray:
        """Which corners count: those of gates that are found, or that the picture has another corner of.  (n,)

        A gate that may stand anywhere within 15 cm lets a corner pass that was taken for its by mistake; it would be
        moved there, and refuse its own corners ever after.
        """
        if not self._free:
            return np.ones(len(gates), bool)
        first = MOVING + len(belief.drift)
        variance = np.diag(belief.P)[first:].reshape(-1, 3).max(axis=1)
        return (variance[gates] < FOUND**2) | (np.bincount(gates)[gates] > 1)

    def _jacobian(
        self, belief: Belief, R: np.ndarray, body: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray, gates
    ) -> np.ndarray:
        """Of the pixels by the error: the corner in the body frame is R^T (c - p), turned by -dtheta.  (2 n, states)"""
        n = len(body)
        by_camera = np.zeros((n, 2, 3))
        fx, fy = self._config.fx, self._config.fy
        by_camera[:, 0, 0], by_camera[:, 1, 1] = fx / z, fy / z
        by_camera[:, 0, 2], by_camera[:, 1, 2] = -fx * x / z**2, -fy * y / z**2
        by_body = by_camera @ self._rotation  # (n, 2, 3)
        by_world = by_body @ R.T
        H = np.zeros((n, 2, len(belief.P)))
        H[:, :, POSITION] = -by_world
        (a, b, c), (p, q, r) = by_body.transpose(2, 0, 1), body.T[:, :, None]  # a row a of it: a @ [b]_x = a x b
        H[:, :, 6], H[:, :, 7], H[:, :, 8] = b * r - c * q, c * p - a * r, a * q - b * p
        if self._free:
            first = MOVING + len(belief.drift) + 3 * gates
            for k in range(3):
                H[np.arange(n), :, first + k] = by_world[:, :, k]
        return H.reshape(2 * n, -1)


def corrected(belief: Belief, H: np.ndarray, z: np.ndarray, R: np.ndarray, group: int) -> tuple[Belief, Innovation]:
    """The belief after innovations z (m,) of Jacobian H (m, n) and variances R (m,), gated in groups of so many.

    Each group is gated by itself, then all that is left together: while its NIS is beyond JOINT standard deviations,
    the group that fits worst after the correction is left out. An uncertain state lets every single group pass.
    """
    PHt = belief.P @ H.T  # (n, m)
    S = H @ PHt
    S.flat[:: len(S) + 1] += R
    number = np.arange(len(z) // group)
    each = z.reshape(-1, group)
    blocks = S.reshape(len(number), group, len(number), group)[number, :, number, :]
    nis = (each * np.linalg.solve(blocks, each[:, :, None])[:, :, 0]).sum(axis=1)
    good = nis < GATE[group]
    while good.any():
        rows = np.flatnonzero(np.repeat(good, group))
        part = PHt[:, rows]
        solved = np.linalg.solve(S[np.ix_(rows, rows)], np.column_stack([part.T, z[rows]]))  # S^-1 [H P, z]
        dx, total, m = part @ solved[:, -1], float(z[rows] @ solved[:, -1]), len(rows)
        if total < m + JOINT * sqrt(2.0 * m) or m == group:
            after = belief.P - part @ solved[:, :-1]
            refused = group * int((~good).sum())
            return belief.corrected(dx, 0.5 * (after + after.T)), Innovation(total, m, refused)
        left = (((z - H @ dx) ** 2 / R).reshape(-1, group)).sum(axis=1)
        good[np.argmax(np.where(good, left, -1.0))] = False
    return belief, Innovation(0.0, 0, len(z))
