"""The error-state Kalman filter of a vehicle with an inertial measurement unit.

The nominal state moves by the unit alone (quadsim.sensing.estimation.nominal). The filter estimates
its error dx = (dp, dv, dtheta, db_a, db_g), then the drift of an odometry (3,), then how far gates
stand off the map (3 each):

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

# Rows of the error. The drift and the gates follow, where there are any.
POSITION = slice(0, 3)
VELOCITY = slice(3, 6)
TURN = slice(6, 9)
ACCELEROMETER = slice(9, 12)
GYRO = slice(12, 15)
MOVING = 15  # of the states, those that the unit moves
DRIFT = slice(MOVING, MOVING + 3)
# [m/s^2] standard deviation of a sample: what holding means over a sample leaves out
MODEL_ACCELERATION = 0.3


@dataclass(frozen=True)
class FilterState:
    """The nominal state, the other states of the filter, and the covariance of the error, at one
    instant."""

    nominal: Nominal
    drift: np.ndarray  # of an odometry's position [m]  (3,)
    gates: np.ndarray  # where gates stand less where the map has them [m]  (gates, 3)
    P: np.ndarray  # covariance of the error; without drift or gates they are left out  (n, n)

    @property
    def first_gate(self) -> int:
        """Row of the error at which the gates begin."""
        return MOVING + len(self.drift)

    def gate_std(self, gates: int) -> np.ndarray:
        """Return the standard deviation of each gate's position relative to the vehicle, of the
        worst axis [m].

        Args:
            gates: how many there are; those that stand where the map has them are as uncertain as
                the vehicle.

        Returns:
            (gates,)
        """
        own = np.diag(self.P)[POSITION]
        if not len(self.gates):
            return np.full(gates, np.sqrt(own.max()))
        rows = np.arange(self.first_gate, len(self.P)).reshape(-1, 3)  # of each gate
        variances = self.P[rows, rows] + own - 2.0 * self.P[np.arange(3), rows]
        return np.sqrt(np.maximum(variances, 0.0).max(axis=1))

    def corrected(self, dx: np.ndarray, P: np.ndarray) -> FilterState:
        """Return the state with an error moved into it.

        Args:
            dx: the error  (n,).
            P: its covariance afterwards  (n, n).
        """
        old, error = self.nominal, dx.tolist()
        nominal = Nominal(
            old.t,
            plus(old.position, error[POSITION]),
            plus(old.velocity, error[VELOCITY]),
            turned(old.attitude, error[TURN]),
            plus(old.accelerometer_bias, error[ACCELEROMETER]),
            plus(old.gyro_bias, error[GYRO]),
        )
        drift = self.drift + dx[MOVING : self.first_gate]
        gates = self.gates + dx[self.first_gate :].reshape(self.gates.shape)
        return FilterState(nominal, drift, gates, P)


class Motion:
    """Moves a FilterState by samples of a unit with these noises."""

    def __init__(self, imu: ImuConfig, drift: float, states: int):
        """drift: of an odometry's position [m/sqrt(s)]; states: of the filter."""
        accelerometer = imu.accelerometer_noise**2 + MODEL_ACCELERATION**2
        # per second
        white = np.repeat([0.0, accelerometer, imu.gyro_noise**2, 0.0, 0.0], 3) / imu.rate
        walk = np.repeat([0.0, 0.0, 0.0, imu.accelerometer_walk**2, imu.gyro_walk**2], 3)
        self._rate = np.zeros(states)  # of growth of the variances [1/s]
        self._rate[:MOVING] = white + walk
        self._rate[DRIFT] += drift**2
        self._F = np.eye(MOVING)

    def __call__(self, state: FilterState, sample: Inertial, until: float) -> FilterState:
        """Return the state at `until` [s], the sample's means held."""
        return replace(
            state, nominal=state.nominal.moved(sample, until), P=self.moved(state, sample, until)
        )

    def moved(self, state: FilterState, sample: Inertial, until: float) -> np.ndarray:
        """Return the covariance at `until` [s], to first order in the time.  (n, n)"""
        nominal, F = state.nominal, self._F
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
