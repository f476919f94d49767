"""The state of the error-state Kalman filter of a vehicle with an inertial measurement unit.

The filter estimates the error dx = (dp, dv, dtheta, db_a, db_g) of the nominal state
(quadsim.sensing.nominal), the drift of an odometry (3,), and the displacement of each gate from the
map (3 each). Attitude errors are in the body frame, q = q_nominal exp(dtheta). A measurement
corrects the error, which is then added to the nominal state. The formulation follows J. Sola,
"Quaternion kinematics for the error-state Kalman filter", arXiv:1711.02508, 2017, chapters 5 and 6.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from quadsim.rotation import Vec3, turned
from quadsim.sensing.nominal import Nominal

# Rows of the error; rows of the drift and of the gates follow if these are estimated.
POSITION = slice(0, 3)
VELOCITY = slice(3, 6)
TURN = slice(6, 9)
ACCELEROMETER = slice(9, 12)
GYRO = slice(12, 15)
# number of the states that move with the unit
MOVING = 15
DRIFT = slice(MOVING, MOVING + 3)


@dataclass(frozen=True)
class FilterState:
    """The nominal state and the covariance of its error at one instant.

    The covariance has rows for drift and gates only if they are estimated.
    """

    nominal: Nominal
    # drift of an odometry's position [m]  (3,) or (0,)
    drift: np.ndarray
    # positions of gates relative to the map [m]  (gates, 3) or (0, 3)
    gates: np.ndarray
    # covariance of the error  (n, n)
    P: np.ndarray

    @property
    def first_gate(self) -> int:
        """The index of the first row of the gates in the error state."""
        return MOVING + len(self.drift)

    def gate_std(self, gates: int) -> np.ndarray:
        """Return the standard deviation of each gate's position relative to the vehicle [m].

        Args:
            gates: number of gates; if gates are fixed to the map, each is as uncertain as the
                vehicle.

        Returns:
            Standard deviation along the worst axis of each gate  (gates,).
        """
        own = np.diag(self.P)[POSITION]
        if not len(self.gates):
            return np.full(gates, np.sqrt(own.max()))
        rows = np.arange(self.first_gate, len(self.P)).reshape(-1, 3)  # rows of each gate
        variances = self.P[rows, rows] + own - 2.0 * self.P[np.arange(3), rows]
        return np.sqrt(np.maximum(variances, 0.0).max(axis=1))

    def corrected(self, dx: np.ndarray, P: np.ndarray) -> FilterState:
        """Return the state after injecting an estimated error into the nominal state.

        Args:
            dx: the error  (n,).
            P: covariance of the remaining error  (n, n).
        """
        before = self.nominal
        error = dx.tolist()
        nominal = Nominal(
            t=before.t,
            position=plus(before.position, error[POSITION]),
            velocity=plus(before.velocity, error[VELOCITY]),
            attitude=turned(before.attitude, error[TURN]),
            accelerometer_bias=plus(before.accelerometer_bias, error[ACCELEROMETER]),
            gyro_bias=plus(before.gyro_bias, error[GYRO]),
        )
        drift = self.drift + dx[MOVING : self.first_gate]
        gates = self.gates + dx[self.first_gate :].reshape(self.gates.shape)
        return FilterState(nominal, drift, gates, P)


def plus(vector: Vec3, error: Iterable[float]) -> Vec3:
    """Return the sum of two vectors  (3,)."""
    x, y, z = (a + b for a, b in zip(vector, error, strict=True))
    return x, y, z
