"""What a flight tells about its vehicle: how much thrust accelerates it, its drag, what the rotors can give at most.

A Kalman filter on theta = (k, d, w), thrust gain [], drag [1/s] and gust [m/s^2]; k and d stay, w decays in tau:

    v' + g e_z = k R(q) e_z a - d v + w,     w' = -w / tau + noise

and the highest thrust that the rotors were seen to give when asked for more. A controller that is told learns within a
second that it carries 4 % too much: offset-free predictive control, Pannocchia and Rawlings, AIChE Journal 49(2), 2003,
with the disturbance where it arises, as it turns with the vehicle.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp

import numpy as np

from quadsim.systems import System
from quadsim.systems.quadrotor import ModelParams, gain, quadrotor
from quadsim.vehicle import GRAVITY

MEASUREMENT = 0.05  # [m/s^2] of v' from two states: what the trapezium over one period leaves
CALM = 0.15  # [m/s^2] a thrust that moves no more in a period has settled
SHORT = 0.5  # [m/s^2] less than asked for
LITTLE = 0.05  # share of the highest thrust: what roll and pitch take may be no more, as it is known less well
SETTLE = 0.1  # share by which each settled period moves the highest thrust


@dataclass(frozen=True)
class AdaptationConfig:
    """The filter's prior: how far a real vehicle may be from its nominal model. Half widths of uniform laws.

    The numbers are those of a careful outdoor flight: a battery more or less, drag as well as it is usually known,
    1.25 m/s of wind on a drag of 0.4 1/s.
    """

    mass: float = 0.05  # relative, of the thrust gain
    drag: float = 0.25  # relative
    gust: float = 0.5  # standard deviation per axis [m/s^2]
    gust_tau: float = 0.5  # correlation time [s]


class Adaptation:
    """Learns from the states between plans."""

    def __init__(self, model: ModelParams, dt: float, config: AdaptationConfig | None = None):
        self._nominal, self._dt = model, dt
        self._config = c = config or AdaptationConfig()
        self._theta = np.array([model.thrust_gain, model.drag, 0.0, 0.0, 0.0])
        spread = np.array([c.mass, c.drag * model.drag]) / np.sqrt(3)  # of uniform laws
        self._P = np.diag([*spread**2, *(c.gust**2,) * 3])
        self._thrust_max = model.thrust_max
        self._tilt = np.array(
            [c * gain(tau, dt) / dt for c, tau in zip(model.tilt_cost, model.rate_tau[:2], strict=True)]
        )
        self._settle = gain(model.motor_tau, dt)
        self._before: np.ndarray | None = None

    @property
    def model(self) -> ModelParams:
        """The nominal one with what has been learnt."""
        k, d = self._theta[:2].tolist()
        return replace(self._nominal, thrust_gain=k, drag=d, thrust_max=self._thrust_max)

    @property
    def std(self) -> np.ndarray:
        """Of thrust gain and drag as they are believed now.  (2,)"""
        return np.sqrt(np.diag(self._P)[:2])

    def observe(self, x: np.ndarray, u: np.ndarray, elapsed: int) -> System:
        """Learn from the way to x under u, `elapsed` control periods after the last state.  x (17,), u (4,)"""
        x0, self._before = self._before, x
        if x0 is not None and elapsed:
            self._accelerated(x0, x, elapsed * self._dt)
            self._saturated(x0, x, u)
        return quadrotor(self.model, self._dt)

    def _accelerated(self, x0: np.ndarray, x: np.ndarray, dt: float) -> None:
        """One step of the filter."""
        keep = exp(-dt / self._config.gust_tau)
        F = np.array([1.0, 1.0, keep, keep, keep])
        Q = np.array([0.0, 0.0, *(self._config.gust**2 * (1 - keep**2),) * 3])
        theta, P = F * self._theta, F[:, None] * self._P * F + np.diag(Q)
        y = (x[3:6] - x0[3:6]) / dt + np.array([0.0, 0.0, GRAVITY])
        H = np.column_stack([(thrust(x0) + thrust(x)) / 2, -(x0[3:6] + x[3:6]) / 2, np.eye(3)])
        K = np.linalg.solve(H @ P @ H.T + MEASUREMENT**2 * np.eye(3), H @ P).T
        self._theta, self._P = theta + K @ (y - H @ theta), P - K @ H @ P

    def _saturated(self, x0: np.ndarray, x: np.ndarray, u: np.ndarray) -> None:
        """Rotors that have settled below what they were asked for give what they can."""
        change = x[13] - x0[13]
        settled = x0[13] + change / self._settle
        if abs(change) < CALM and u[3] > settled + SHORT:
            room = self._tilt @ (abs(u[:2] - x0[10:12]) + abs(u[:2] - x[10:12])) / 2  # r of the model
            if room < LITTLE * self._thrust_max:
                self._thrust_max += SETTLE * (settled + room - self._thrust_max)


def thrust(x: np.ndarray) -> np.ndarray:
    """R(q) e_z a, what the rotors deliver in the world's frame.  [m/s^2] (3,)"""
    w, i, j, k = x[6:10]
    return x[13] * np.array([2 * (i * k + w * j), 2 * (j * k - w * i), 1 - 2 * (i * i + j * j)])
