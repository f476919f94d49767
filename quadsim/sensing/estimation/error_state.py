"""The error-state Kalman filter of a vehicle with an inertial measurement unit.

The unit alone propagates the nominal state (quadsim.sensing.estimation.nominal). The filter
estimates the error dx = (dp, dv, dtheta, db_a, db_g) of the nominal state, the drift of an odometry
(3,), and the displacement of each gate from the map (3 each):

    dp' = dv,   dv' = -R [f]_x dtheta - R db_a,   dtheta' = -[omega]_x dtheta - db_g

with attitude errors in the body frame, q = q_nominal exp(dtheta). A measurement corrects the error,
which is then moved into the nominal state. Formulation: J. Sola, "Quaternion kinematics for the
error-state Kalman filter", arXiv:1711.02508, 2017, chapters 5 and 6.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from quadsim.rotation import Vec3, matrix, skew, turned
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.estimation.nominal import Nominal
from quadsim.sensing.measurements import Inertial

# Rows of the error; rows of the drift and of the gates follow if these are estimated.
POSITION = slice(0, 3)
VELOCITY = slice(3, 6)
TURN = slice(6, 9)
ACCELEROMETER = slice(9, 12)
GYRO = slice(12, 15)
# number of the states that move with the unit
MOVING = 15
DRIFT = slice(MOVING, MOVING + 3)
# [m/s^2] standard deviation per sample of the error made by holding means over a sample
MODEL_ACCELERATION = 0.3


@dataclass(frozen=True)
class FilterState:
    """The nominal state and the covariance of its error at one instant.

    Drift and gates have rows only if they are estimated.
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
        """The first row of the gates in the error."""
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


class Motion:
    """Moves a FilterState by samples of an inertial measurement unit: the filter's prediction."""

    def __init__(self, imu: ImuConfig, drift: float, states: int):
        """Prepare the process noise.

        Args:
            imu: the unit.
            drift: random walk of an odometry's position [m/sqrt(s)].
            states: number of the filter's states.
        """
        # Noise of a sample is white at the unit's rate; biases are random walks.
        accelerometer = imu.accelerometer_noise**2 + MODEL_ACCELERATION**2
        white = np.repeat([0.0, accelerometer, imu.gyro_noise**2, 0.0, 0.0], 3) / imu.rate
        walk = np.repeat([0.0, 0.0, 0.0, imu.accelerometer_walk**2, imu.gyro_walk**2], 3)
        # growth of the variances per second  (states,)
        self._rate = np.zeros(states)
        self._rate[:MOVING] = white + walk
        self._rate[DRIFT] += drift**2
        self._F = np.eye(MOVING)

    def __call__(self, state: FilterState, sample: Inertial, until: float) -> FilterState:
        """Return the state at `until` [s], with the sample held constant."""
        nominal = state.nominal.moved(sample, until)
        return replace(state, nominal=nominal, P=self.moved(state, sample, until))

    def moved(self, state: FilterState, sample: Inertial, until: float) -> np.ndarray:
        """Return the covariance at `until` [s], to first order in the time.  (n, n)"""
        # The Jacobian of the error dynamics, for the states that move.
        nominal = state.nominal
        F = self._F
        dt = until - nominal.t
        wx, wy, wz = nominal.rates(sample)
        R = dt * matrix(nominal.attitude)
        F[POSITION, VELOCITY] = np.diag([dt, dt, dt])
        F[VELOCITY, TURN] = -R @ skew(nominal.force(sample))
        F[VELOCITY, ACCELEROMETER] = -R
        F[TURN, TURN] = [
            [1.0, dt * wz, -dt * wy],
            [-dt * wz, 1.0, dt * wx],
            [dt * wy, -dt * wx, 1.0],
        ]
        F[TURN, GYRO] = np.diag([-dt, -dt, -dt])

        # Drift and gates stand still: only the rows and columns of the other states are multiplied.
        P = state.P.copy()
        P[:MOVING] = F @ P[:MOVING]
        P[:, :MOVING] = P[:, :MOVING] @ F.T
        P.flat[:: len(P) + 1] += dt * self._rate
        return P


def plus(vector: Vec3, error: Iterable[float]) -> Vec3:
    """Return the sum of two vectors."""
    x, y, z = (a + b for a, b in zip(vector, error, strict=True))
    return x, y, z
