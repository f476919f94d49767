"""The prediction of the filter: its state moved by samples of an inertial measurement unit.

The unit alone propagates the nominal state. The error of the nominal state moves by

    dp' = dv,   dv' = -R [f]_x dtheta - R db_a,   dtheta' = -[omega]_x dtheta - db_g
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from quadsim.rotation import matrix, skew
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.measurements import Inertial
from quadsim.sensing.state import (
    ACCELEROMETER,
    DRIFT,
    GYRO,
    MOVING,
    POSITION,
    TURN,
    VELOCITY,
    FilterState,
)

# [m/s^2] standard deviation per sample of the error made by holding means over a sample
MODEL_ACCELERATION = 0.3


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
