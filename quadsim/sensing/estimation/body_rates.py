"""Body rates and angular accelerations: the model's prediction, corrected by the gyroscope."""

from __future__ import annotations

import numpy as np

from quadsim.dynamics.first_order import response
from quadsim.dynamics.quadrotor import (
    Control,
    Delivered,
    Drive,
    ModelParams,
    deliver,
    rate_loop,
    tilt_reserve,
)
from quadsim.rotation import Vec3
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.estimation.nominal_rotors import Turning

# [rad/s^2] standard deviation of the model's error in angular acceleration per period
ACCELERATION_STD = 20.0
# [rad/s] lower bound of the gyroscope's assumed noise
LEAST_GYRO_NOISE = 1e-3


class BodyRates:
    """An observer of the body rates omega and of the angular accelerations beta by the rotors.

        beta <- beta + (beta_cmd - beta) k_beta,    beta_cmd = (omega_cmd - omega) k_omega
        omega <- omega + beta dt

    The gains k_beta and k_omega are defined in quadsim.dynamics.quadrotor. What is known of unequal
    rotors changes beta_cmd as in the model. Then the gyroscope
    corrects omega and beta with the steady-state gain of a Kalman filter, once each control period.
    """

    def __init__(self, model: ModelParams, dt: float, imu: ImuConfig):
        """Start at rest.

        Args:
            model: the nominal model.
            dt: control period [s].
            imu: numbers of the unit with the gyroscope.
        """
        self._dt = dt
        self._tilt_cost = model.tilt_cost
        self._responses = tuple(response(lag, dt) for lag in model.rate_lags)
        # [1/s]
        self._gains = tuple(response(tau, dt) / dt for tau in model.rate_tau)
        noise = max(imu.gyro_noise, LEAST_GYRO_NOISE)
        self._corrections = [
            steady_gain(dt, share, ACCELERATION_STD, noise) for share in self._responses
        ]
        # [rad/s]
        self.rates: Vec3 = (0.0, 0.0, 0.0)
        # [rad/s^2]
        self.angular_acceleration: Vec3 = (0.0, 0.0, 0.0)

    @property
    def turning(self) -> Turning:
        """The present estimate."""
        return Turning(self.rates, self.angular_acceleration)

    def advance(
        self,
        u: Control,
        measured: Vec3 | None,
        delivered: Delivered = Delivered(),  # noqa: B008 (immutable)
    ) -> None:
        """Move by one control period under the command u.

        Args:
            u: the command.
            measured: body rates at the period's end [rad/s]  (3,); None: there was no sample.
            delivered: what the vehicle delivers of what its rotors are asked for.
        """
        asked = rate_loop(self.rates, u.body_rates, self._gains)
        commanded = deliver(Drive(u.thrust, *asked), delivered)[1:]
        rates = []
        acceleration = []
        for k in range(3):
            # Predict.
            beta = self.angular_acceleration[k]
            beta = beta + (commanded[k] - beta) * self._responses[k]
            omega = self.rates[k] + beta * self._dt

            # Correct by the gyroscope.
            innovation = measured[k] - omega if measured else 0.0
            on_rate, on_acceleration = self._corrections[k]
            rates.append(omega + on_rate * innovation)
            acceleration.append(beta + on_acceleration * innovation)
        self.rates = tuple(rates)
        self.angular_acceleration = tuple(acceleration)

    def reserve(self, u: Control) -> float:
        """Return the thrust that roll and pitch take under the command u [m/s^2]."""
        bx_cmd, by_cmd, _ = rate_loop(self.rates, u.body_rates, self._gains)
        return tilt_reserve(*self._tilt_cost, bx_cmd, by_cmd)


def steady_gain(
    dt: float, share: float, acceleration_std: float, noise: float
) -> tuple[float, float]:
    """Return the steady-state Kalman gain from the gyroscope to (omega, beta).

        omega <- omega + beta dt
        beta <- (1 - share) beta + acceleration_std N(0, 1)

    Args:
        dt: control period [s].
        share: share of its difference to the command that beta closes in a period.
        acceleration_std: standard deviation of the process [rad/s^2].
        noise: standard deviation of the gyroscope [rad/s].
    """
    keep = 1.0 - share
    F = np.array([[1.0, keep * dt], [0.0, keep]])
    Q = acceleration_std**2 * np.array([[dt * dt, dt], [dt, 1.0]])
    P = Q.copy()
    R = noise**2
    for _ in range(200):
        P = F @ P @ F.T + Q
        gain = P[:, 0] / (P[0, 0] + R)
        P = P - np.outer(gain, P[0])
    return float(gain[0]), float(gain[1])
