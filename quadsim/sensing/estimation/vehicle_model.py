"""What flight says of the vehicle: the thrust delivered now, thrust gain, highest thrust, drag; from the accelerometer.

An extended Kalman filter of theta = (a, a_max, k, d, w): delivered and highest thrust [m/s^2], thrust gain [], drag
[1/s] and gust in the world (3,) [m/s^2]. Over a control period

    a <- a + (clip(a_cmd, r, a_max - r) - a) k_m + noise,     w <- exp(-dt / tau) w + noise
    specific force = k a e_z - d R^T v + R^T w + noise

with the model's rotor lag k_m and its reserve r for roll and pitch (quadsim.systems.quadrotor). An accelerometer
measures the specific force itself, where differences of an estimated velocity would carry its noise over dt; k and d
follow only as far as their own variances say, so that little is learnt of a noisy sensor. Rotor speeds, where there are
any, measure a. Body rates and angular accelerations are those of the model, corrected by the gyroscope.

The disturbance as a state makes the predictions offset-free (Pannocchia and Rawlings, AIChE Journal 49(2), 2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from quadsim.sensing.attitude import Vector, matrix
from quadsim.sensing.config import ImuConfig
from quadsim.sensing.estimation.nominal import Nominal
from quadsim.systems.first_order import remaining, response
from quadsim.systems.quadrotor import ModelParams, tilt_reserve
from quadsim.vehicle import GRAVITY

A, A_MAX, K, D, W = 0, 1, 2, 3, slice(4, 7)


@dataclass(frozen=True)
class ModelPrior:
    """How far a real vehicle may be from its nominal model; those of controllers.adaptation.AdaptationConfig."""

    mass: float = 0.05  # relative, half width
    thrust: float = 0.05  # relative, half width
    drag: float = 0.25  # relative, half width
    lag: float = 0.2  # relative, half width, of the rotors
    gust: float = 0.5  # standard deviation per axis [m/s^2]
    gust_tau: float = 0.5  # correlation time [s]


THRUST_NOISE = 0.3  # [m/s^2] of a specific force: means over a period, flow that the drag leaves out
RATE_NOISE = 20.0  # [rad/s^2] by which angular accelerations differ from the model's in a period
OUTLIER = 25.0  # of the normalised innovation squared, 3 degrees of freedom


class VehicleModel:
    """Learns the numbers of a quadrotor's model in flight, once each control period."""

    def __init__(self, model: ModelParams, dt: float, imu: ImuConfig, prior: ModelPrior | None = None):
        """model: the nominal one, at which the estimates start. dt: control period [s]."""
        c = prior or ModelPrior()
        self._nominal, self._dt, self._prior = model, dt, c
        self._theta = np.array([GRAVITY, model.thrust_max, model.thrust_gain, model.drag, 0.0, 0.0, 0.0])
        std = [0.5, c.thrust * model.thrust_max, c.mass, c.drag * max(model.drag, 0.1)]
        self._P = np.diag([std[0] ** 2, *(s * s / 3 for s in std[1:]), *(c.gust**2,) * 3])
        self._lag, self._keep = response(model.motor_tau, dt), remaining(c.gust_tau, dt)
        self._R = (imu.accelerometer_noise**2 + THRUST_NOISE**2) * np.eye(3)
        self._gains = tuple(response(tau, dt) / dt for tau in model.rate_tau)  # [1/s]
        self._correction = _steady_gain(dt, self._lag, RATE_NOISE, imu.gyro_noise)
        self.omega: Vector = (0.0, 0.0, 0.0)  # [rad/s]
        self.beta: Vector = (0.0, 0.0, 0.0)  # [rad/s^2]

    @property
    def model(self) -> ModelParams:
        """The nominal parameters with the present estimates in their place."""
        _, most, k, d = self._theta[:4].tolist()
        return replace(self._nominal, thrust_gain=k, drag=d, thrust_max=most)

    @property
    def thrust(self) -> float:
        """Delivered now [m/s^2]."""
        return float(self._theta[A])

    @property
    def std(self) -> np.ndarray:
        """Standard deviations of the delivered and highest thrust [m/s^2], thrust gain and drag [1/s].  (4,)"""
        return np.sqrt(np.diag(self._P)[:4])

    def period(self, u: Vector, force: Vector | None, rates: Vector | None, nominal: Nominal) -> None:
        """One control period under the command u (4,), in which the unit measured this mean specific force and, at
        its end, these body rates; without samples, None. nominal: at its end."""
        before = self._reserve(u)
        self._turn(u, rates)
        self._predict(u[3], max(before, self._reserve(u)))
        if force is not None:
            self._correct(np.array(force), nominal)

    def measured(self, thrust: float, std: float) -> None:
        """The delivered thrust by the rotor speeds, with its standard deviation [m/s^2]."""
        gain = self._P[:, A] / (self._P[A, A] + std * std)
        self._theta = self._theta + gain * (thrust - self._theta[A])
        self._P = self._P - np.outer(gain, self._P[A])

    def _reserve(self, u: Vector) -> float:
        """r: the thrust that roll and pitch take [m/s^2]."""
        commanded = ((u[k] - self.omega[k]) * self._gains[k] for k in (0, 1))
        return tilt_reserve(*self._nominal.tilt_cost, *commanded)

    def _turn(self, u: Vector, rates: Vector | None) -> None:
        """Body rates and angular accelerations, by the model and then by the gyroscope."""
        dt, (on_rate, on_acceleration) = self._dt, self._correction
        omega, beta = [], []
        for k in range(3):
            b = self.beta[k] + ((u[k] - self.omega[k]) * self._gains[k] - self.beta[k]) * self._lag
            w = self.omega[k] + b * dt
            error = rates[k] - w if rates else 0.0
            omega.append(w + on_rate * error)
            beta.append(b + on_acceleration * error)
        self.omega, self.beta = tuple(omega), tuple(beta)

    def _predict(self, a_cmd: float, reserve: float) -> None:
        theta, c, F = self._theta, self._prior, np.eye(7)
        most = theta[A_MAX] - reserve
        limited = a_cmd > most
        step = (most if limited else max(a_cmd, reserve)) - theta[A]
        F[A, A] = 1.0 - self._lag
        F[A, A_MAX] = self._lag if limited else 0.0
        F[4, 4] = F[5, 5] = F[6, 6] = self._keep
        theta = F @ theta
        theta[A] = self._theta[A] + self._lag * step
        Q = np.zeros(7)
        unsure = c.lag * self._lag * step / sqrt(3) + 0.3 * reserve * self._lag  # of lag and reserve
        Q[A], Q[A_MAX], Q[W] = unsure**2 + 0.05**2, 1e-4 * self._dt, c.gust**2 * (1.0 - self._keep**2)
        self._theta, self._P = theta, F @ self._P @ F.T + np.diag(Q)

    def _correct(self, force: np.ndarray, nominal: Nominal) -> None:
        a, _, k, d = self._theta[:4].tolist()
        Rt = matrix(nominal.q).T
        v, w = Rt @ nominal.v, Rt @ self._theta[W]
        H = np.zeros((3, 7))
        H[2, A], H[2, K] = k, a
        H[:, D], H[:, W] = -v, Rt
        error = force - (w - d * v)
        error[2] -= k * a
        PHt = self._P @ H.T
        S = H @ PHt + self._R
        found = np.linalg.solve(S, np.column_stack([PHt.T, error]))
        if error @ found[:, -1] < OUTLIER:
            self._theta = self._theta + PHt @ found[:, -1]
            P = self._P - PHt @ found[:, :-1]
            self._P = 0.5 * (P + P.T)


def _steady_gain(dt: float, lag: float, unsure: float, noise: float) -> tuple[float, float]:
    """The Kalman gain of (omega, beta) on a gyroscope of this noise [rad/s], once it has settled.

    omega <- omega + beta dt, beta <- (1 - lag) beta + unsure N(0, 1) [rad/s^2]
    """
    keep = 1.0 - lag
    F, Q = np.array([[1.0, keep * dt], [0.0, keep]]), unsure**2 * np.array([[dt * dt, dt], [dt, 1.0]])
    P, R = Q.copy(), max(noise, 1e-3) ** 2
    for _ in range(200):
        P = F @ P @ F.T + Q
        gain = P[:, 0] / (P[0, 0] + R)
        P = P - np.outer(gain, P[0])
    return float(gain[0]), float(gain[1])
