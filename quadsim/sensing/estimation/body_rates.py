"""Body rates and angular accelerations: the model's own, corrected by the gyroscope once each
control period."""

from __future__ import annotations

import numpy as np

from quadsim.dynamics.first_order import response
from quadsim.dynamics.quadrotor import Control, ModelParams, tilt_reserve
from quadsim.rotation import Vec3
from quadsim.sensing.config import ImuConfig

# [rad/s^2] by which angular accelerations differ from the model's in a period
ACCELERATION_STD = 20.0
LEAST_GYRO_NOISE = 1e-3  # [rad/s] a gyroscope is never taken for better


class BodyRates:
    """Observes what the body's rates are, and what the rotors do to change them.

    beta <- beta + (beta_cmd - beta) k_m,   beta_cmd = (omega_cmd - omega) k_omega,   omega <- omega
    + beta dt

    k_m and k_omega are those of quadsim.dynamics.quadrotor. Then both are corrected by the
    gyroscope, with the settled gain of a Kalman filter.
    """

    def __init__(self, model: ModelParams, dt: float, imu: ImuConfig):
        """dt: control period [s]."""
        self._dt, self._tilt_cost = dt, model.tilt_cost
        self._rotor_response = response(model.motor_tau, dt)
        self._gains = tuple(response(tau, dt) / dt for tau in model.rate_tau)  # [1/s]
        self._on_rate, self._on_acceleration = steady_gain(
            dt, self._rotor_response, ACCELERATION_STD, max(imu.gyro_noise, LEAST_GYRO_NOISE)
        )
        self.rates: Vec3 = (0.0, 0.0, 0.0)  # [rad/s]
        self.angular_acceleration: Vec3 = (0.0, 0.0, 0.0)  # [rad/s^2]

    def advance(self, u: Control, measured: Vec3 | None) -> None:
        """Move by one control period under the command u.

        Args:
            measured: body rates at its end [rad/s]  (3,); None: there was no sample.
        """
        rates, acceleration = [], []
        for k in range(3):
            beta = self.angular_acceleration[k]
            beta = beta + ((u[k] - self.rates[k]) * self._gains[k] - beta) * self._rotor_response
            omega = self.rates[k] + beta * self._dt
            innovation = measured[k] - omega if measured else 0.0
            rates.append(omega + self._on_rate * innovation)
            acceleration.append(beta + self._on_acceleration * innovation)
        self.rates, self.angular_acceleration = tuple(rates), tuple(acceleration)

    def reserve(self, u: Control) -> float:
        """Return the thrust that roll and pitch take under the command u [m/s^2]."""
        bx_cmd = (u.wx - self.rates[0]) * self._gains[0]
        by_cmd = (u.wy - self.rates[1]) * self._gains[1]
        return tilt_reserve(*self._tilt_cost, bx_cmd, by_cmd)


def steady_gain(
    dt: float, rotor_response: float, acceleration_std: float, noise: float
) -> tuple[float, float]:
    """Return the Kalman gain of (omega, beta) on a gyroscope of this noise [rad/s], once it has
    settled.

    omega <- omega + beta dt, beta <- (1 - rotor_response) beta + acceleration_std N(0, 1) [rad/s^2]
    """
    keep = 1.0 - rotor_response
    F = np.array([[1.0, keep * dt], [0.0, keep]])
    Q = acceleration_std**2 * np.array([[dt * dt, dt], [dt, 1.0]])
    P, R = Q.copy(), noise**2
    for _ in range(200):
        P = F @ P @ F.T + Q
        gain = P[:, 0] / (P[0, 0] + R)
        P = P - np.outer(gain, P[0])
    return float(gain[0]), float(gain[1])
