"""The error-state Kalman filter of a vehicle with an inertial measurement unit.

The nominal state moves by the unit alone (quadsim.sensing.estimation.nominal). The filter estimates its error
dx = (dp, dv, dtheta, db_a, db_g), then the drift of an odometry (3,), then how far gates stand off the map (3 each):

    dp' = dv,   dv' = -R [f]_x dtheta - R db_a,   dtheta' = -[omega]_x dtheta - db_g

with attitude errors in the body frame, q = q_nominal exp(dtheta). A measurement corrects the error, which is then moved
into the nominal state. Formulation: J. Sola, "Quaternion kinematics for the error-state Kalman filter",
arXiv:1711.02508, 2017, chapters 5 and 6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from quadsim.sensing.attitude import matrix, skew, turned
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.estimation.nominal import Nominal
from quadsim.sensing.measurements import Inertial

POSITION, VELOCITY, TURN, ACCELEROMETER, GYRO = (slice(3 * k, 3 * k + 3) for k in range(5))
MOVING = 15  # of the states, those that the unit moves
MODEL_ACCELERATION = 0.3  # [m/s^2] standard deviation of a sample: what holding means over a sample leaves out


@dataclass(frozen=True)
class Belief:
    """The filter's state at one instant."""

    nominal: Nominal
    drift: np.ndarray  # of an odometry's position [m]  (3,)
    gates: np.ndarray  # where gates stand less where the map has them [m]  (gates, 3)
    P: np.ndarray  # covariance of the error; without drift or gates they are left out  (n, n)

    def gate_std(self, gates: int) -> np.ndarray:
        """Standard deviation of each gate's position relative to the vehicle, of the worst axis [m].  (gates,)"""
        own = np.diag(self.P)[POSITION]
        if not len(self.gates):
            return np.full(gates, np.sqrt(own.max()))
        first, P = MOVING + len(self.drift), self.P
        of = np.arange(first, len(P)).reshape(-1, 3)  # states of each gate
        variances = P[of, of] + own - 2.0 * P[np.arange(3), of]
        return np.sqrt(np.maximum(variances, 0.0).max(axis=1))

    def corrected(self, dx: np.ndarray, P: np.ndarray) -> Belief:
        """With the error dx (n,) moved into the state; P: its covariance afterwards."""
        n, e = self.nominal, dx.tolist()
        nominal = Nominal(
            n.t,
            tuple(a + b for a, b in zip(n.p, e[0:3], strict=True)),
            tuple(a + b for a, b in zip(n.v, e[3:6], strict=True)),
            turned(n.q, e[6:9]),
            tuple(a + b for a, b in zip(n.accelerometer_bias, e[9:12], strict=True)),
            tuple(a + b for a, b in zip(n.gyro_bias, e[12:15], strict=True)),
        )
        drifts = MOVING + len(self.drift)
        return Belief(nominal, self.drift + dx[MOVING:drifts], self.gates + dx[drifts:].reshape(self.gates.shape), P)


class Motion:
    """Moves a Belief by samples of a unit with these noises."""

    def __init__(self, imu: ImuConfig, drift: float, states: int):
        """drift: of an odometry's position [m/sqrt(s)]; states: of the filter."""
        accelerometer = imu.accelerometer_noise**2 + MODEL_ACCELERATION**2
        self._white = np.repeat([0.0, accelerometer, imu.gyro_noise**2, 0.0, 0.0], 3) / imu.rate  # per second
        self._walk = np.repeat([0.0, 0.0, 0.0, imu.accelerometer_walk**2, imu.gyro_walk**2], 3)
        self._rate = np.zeros(states)  # of growth of the variances [1/s]
        self._rate[:MOVING] = self._white + self._walk
        self._rate[MOVING : MOVING + 3] += drift**2
        self._F = np.eye(MOVING)

    def __call__(self, belief: Belief, sample: Inertial, until: float) -> Belief:
        """The belief at `until` [s], the sample's means held."""
        return replace(belief, nominal=belief.nominal.moved(sample, until), P=self.moved(belief, sample, until))

    def moved(self, belief: Belief, sample: Inertial, until: float) -> np.ndarray:
        """The covariance at `until` [s], to first order in the time.  (n, n)"""
        n, F = belief.nominal, self._F
        dt = until - n.t
        wx, wy, wz = n.rates(sample)
        R = dt * matrix(n.q)
        F[VELOCITY, TURN] = -R @ skew(n.force(sample))
        F[VELOCITY, ACCELEROMETER] = -R
        F[TURN, TURN] = [[1.0, dt * wz, -dt * wy], [-dt * wz, 1.0, dt * wx], [dt * wy, -dt * wx, 1.0]]
        for k in range(3):
            F[k, 3 + k] = dt
            F[6 + k, 12 + k] = -dt
        P = belief.P.copy()
        P[:MOVING] = F @ P[:MOVING]
        P[:, :MOVING] = P[:, :MOVING] @ F.T
        P.flat[:: len(P) + 1] += dt * self._rate
        return P
