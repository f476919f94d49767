"""Adaptation: what the states of a flight say about its vehicle, learnt while it flies.

A Kalman filter estimates theta = (k, d, w): thrust gain k [], drag d [1/s] and gust w [m/s^2] (3,). k and d are
constant, w is an Ornstein-Uhlenbeck process with correlation time tau:

    v' + g e_z = k R(q) e_z a - d v + w,     w' = -w / tau + noise

The left side is measured from two consecutive states, the factors of k and d are taken as the means over the period.
The second quantity is the highest thrust, which the rotors deliver when they have settled below their command. The
third is whether the flight controller gives up thrust to roll and pitch at that limit, by the share of the angular
acceleration asked for that is delivered there: 0.9 in our plant, 0.46 in RotorPy, which clips rotors one by one.
To estimate a disturbance and to plan with it is offset-free predictive control (Pannocchia and Rawlings, AIChE
Journal 49(2), 2003). Here the disturbance is a gain of the thrust and not a constant acceleration, because the effect
of a wrong mass turns with the vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from quadsim.systems import System
from quadsim.systems.first_order import remaining, response
from quadsim.systems.quadrotor import ModelParams, quadrotor, thrust_axis, tilt_reserve
from quadsim.vehicle import GRAVITY

ACCELERATION_STD = 0.05  # [m/s^2] of v' from two states: the error of the trapezoidal rule over one period
SETTLED = 0.15  # [m/s^2] a thrust that changes by less in a period has settled
SHORTFALL = 0.5  # [m/s^2] a settled thrust that is this far below its command is at the rotors' limit
MAX_RESERVE = 0.05  # share of the highest thrust: at a larger reserve for roll and pitch, no estimate is made
STEP = 0.1  # share of the error by which each such period corrects the highest thrust, or the share delivered
ON_TIME = 0.1  # of a period: the share delivered is judged over one period alone
LEAST_RESERVE = 0.03  # share of the highest thrust: at a smaller one the share delivered says little
LEAST_DELIVERED = 0.7  # of the angular acceleration asked for, at the highest thrust; less: the planner gives up thrust


@dataclass(frozen=True)
class AdaptationConfig:
    """The filter's prior: how far a real vehicle may be from its nominal model.

    mass and drag are half widths of uniform distributions; the filter takes their standard deviation. The defaults are
    those of a careful outdoor flight: a battery more or less, drag as well as it is usually known, 1.25 m/s of wind
    on a drag of 0.4 1/s.
    """

    mass: float = 0.05  # relative, of the thrust gain
    drag: float = 0.25  # relative
    gust: float = 0.5  # standard deviation per axis [m/s^2]
    gust_tau: float = 0.5  # correlation time [s]


class Adaptation:
    """Estimates k, d and the highest thrust of a quadrotor; see `controllers.mppi.Adaptation`."""

    def __init__(self, model: ModelParams, dt: float, config: AdaptationConfig | None = None):
        """model: the nominal one, at which the estimates start. dt: control period [s]."""
        self._nominal, self._dt = model, dt
        self._config = c = config or AdaptationConfig()
        self._theta = np.array([model.thrust_gain, model.drag, 0.0, 0.0, 0.0])
        std = np.array([c.mass, c.drag * model.drag]) / np.sqrt(3)  # of uniform distributions of these half widths
        self._P = np.diag([*std**2, *(c.gust**2,) * 3])
        self._thrust_max = model.thrust_max
        self._delivered = 1.0  # of the angular acceleration asked for, at the highest thrust
        self._gains = np.array([response(tau, dt) / dt for tau in model.rate_tau[:2]])
        self._rotor_response = response(model.motor_tau, dt)
        self._before: np.ndarray | None = None

    @property
    def model(self) -> ModelParams:
        """The nominal parameters with the present estimates in their place."""
        k, d = self._theta[:2].tolist()
        tilt_first = self._delivered > LEAST_DELIVERED
        return replace(self._nominal, thrust_gain=k, drag=d, thrust_max=self._thrust_max, tilt_first=tilt_first)

    @property
    def std(self) -> np.ndarray:
        """Standard deviations of the estimates of k and d.  (2,)"""
        return np.sqrt(np.diag(self._P)[:2])

    def observe(self, x: np.ndarray, u: np.ndarray, elapsed: float) -> System:
        """The estimated system, after `elapsed` control periods under u (4,) have led to the state x (17,)."""
        x0, self._before = self._before, x
        if x0 is not None and elapsed:
            self._update_filter(x0, x, elapsed * self._dt)
            self._update_thrust_max(x0, x, u)
            if abs(elapsed - 1) < ON_TIME:
                self._update_delivered(x0, x, u)
        return quadrotor(self.model, self._dt)

    def _update_filter(self, x0: np.ndarray, x: np.ndarray, dt: float) -> None:
        """Predict over dt [s], then correct by the acceleration y = H theta + noise."""
        keep = remaining(self._config.gust_tau, dt)
        F = np.array([1.0, 1.0, keep, keep, keep])
        Q = np.array([0.0, 0.0, *(self._config.gust**2 * (1 - keep**2),) * 3])
        theta, P = F * self._theta, F[:, None] * self._P * F + np.diag(Q)
        y = (x[3:6] - x0[3:6]) / dt + np.array([0.0, 0.0, GRAVITY])
        H = np.column_stack([(thrust(x0) + thrust(x)) / 2, -(x0[3:6] + x[3:6]) / 2, np.eye(3)])
        K = np.linalg.solve(H @ P @ H.T + ACCELERATION_STD**2 * np.eye(3), H @ P).T
        self._theta, self._P = theta + K @ (y - H @ theta), P - K @ H @ P

    def _update_thrust_max(self, x0: np.ndarray, x: np.ndarray, u: np.ndarray) -> None:
        """Where the thrust has settled below its command, it and the reserve for roll and pitch are all there is."""
        change = x[13] - x0[13]
        settled = x0[13] + change / self._rotor_response
        if abs(change) < SETTLED and u[3] > settled + SHORTFALL:
            reserve = self._reserve(x0, x, u)
            if reserve < MAX_RESERVE * self._thrust_max:
                self._thrust_max += STEP * (settled + reserve - self._thrust_max)

    def _update_delivered(self, x0: np.ndarray, x: np.ndarray, u: np.ndarray) -> None:
        """Where thrust and reserve ask for more than there is, compare the angular acceleration with its command."""
        reserve = self._reserve(x0, x, u)
        if reserve > LEAST_RESERVE * self._thrust_max and u[3] > self._thrust_max - reserve / 2:
            asked = self._gains * (u[:2] - (x0[10:12] + x[10:12]) / 2)
            settled = x0[14:16] + (x[14:16] - x0[14:16]) / self._rotor_response
            self._delivered += STEP * (float(settled @ asked / (asked @ asked)) - self._delivered)

    def _reserve(self, x0: np.ndarray, x: np.ndarray, u: np.ndarray) -> float:
        """For roll and pitch, the mean of both ends of the period [m/s^2]."""
        errors = (abs(u[:2] - x0[10:12]) + abs(u[:2] - x[10:12])) / 2
        return tilt_reserve(*self._nominal.tilt_cost, *(self._gains * errors))


def thrust(x: np.ndarray) -> np.ndarray:
    """R(q) e_z a, the delivered thrust in the world.  [m/s^2] (3,)"""
    return x[13] * np.array(thrust_axis(*x[6:10]))
