"""Dynamics x' = f(x, u) of a vehicle, for the optimiser and for the check of its solutions.

The model "rotors" is the vehicle as in the plant, with the lag of four rotor speeds, thrust
map, mixer, rigid body and drag.

The model "rates" is the planner's model, in which body rates and thrust follow commands with
first-order lags; it uses the planner's `step`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product
from math import ceil
from typing import Any

import casadi
import numpy as np

from quadsim.dynamics.allocation import mixer
from quadsim.dynamics.quadrotor import (
    ATTITUDE,
    BODY_RATES,
    RIGID_BODY,
    UNLIMITED_YAW,
    VELOCITY,
    Control,
    ModelParams,
    Params,
    State,
    quadrotor,
    step,
)
from quadsim.dynamics.rate_torque import gyroscopic
from quadsim.limit.limits import ModelName
from quadsim.rotation import quaternion_rate, to_body, to_world
from quadsim.vehicle import GRAVITY, Rotors, Vehicle

# Without this setting, CasADi 3.8 warns that `step` calls numpy's functions on its symbols
if hasattr(casadi.GlobalOptions, "setNumpyMode"):
    casadi.GlobalOptions.setNumpyMode(-1)

# Every state begins with the RIGID_BODY of State. With rotor lag, the four rotor speeds follow, or
# thrust and angular acceleration.
BODY = RIGID_BODY.stop
ROTOR_SPEEDS = slice(BODY, BODY + 4)
# Limit of the body's angular acceleration, beyond the reach of any vehicle [rad/s^2]
SPIN_UP_MAX = 1000.0
# Yaw-rate limit in a race to be flown, as rotors near full thrust cannot yaw [rad/s]
YAW_MAX = 0.5
# Longest step of the check: by Runge-Kutta, and by the planner's step, which is of order 1 [s]
FINE_RUNGE_KUTTA = 1e-3
FINE_STEP = 2e-4


class Dynamics(ABC):
    """A model of the vehicle for the optimiser.

    States x and controls u are tuples of numbers, of CasADi symbols, or of arrays.
    """

    name: ModelName
    # Limits of the state (n_x,); the route sets the limits of position and velocity
    low: np.ndarray
    high: np.ndarray
    # Limits of the control  (n_u,)
    u_low: np.ndarray
    u_high: np.ndarray

    @abstractmethod
    def rate(self, x: Any, u: Any) -> tuple:
        """Return the derivative x' at (x, u)."""

    @abstractmethod
    def fine(self, x: Any, u: Any, dt: float) -> Iterator[tuple]:
        """Yield the states after short steps under a constant u, the last one after dt [s]."""

    @abstractmethod
    def of_flight(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return x and u with the same motion and thrust as a state of the planner's model."""

    def spare(self, x: Any, u: Any) -> tuple:
        """Return the quantities that are constrained to be at least 0."""
        return ()


def dynamics(vehicle: Vehicle, model: str, reserve: float = 0.0) -> Dynamics:
    """Return the model of a vehicle.

    Args:
        vehicle: the vehicle.
        model: "rotors" or "rates".
        reserve: share of the thrust that stays unused, for "rates"; if positive, YAW_MAX applies
            too.

    Raises:
        ValueError: the model does not support the vehicle or the reserve.
    """
    if model == "rates":
        # The cost of yaw is left out to keep the problem smooth; a limit takes its place
        params = replace(ModelParams.of(vehicle), yaw_cost=0.0)
        if reserve:
            roll, pitch, yaw = params.rate_max
            params = replace(
                params,
                rate_max=(roll, pitch, min(yaw, YAW_MAX)),
                thrust_max=(1.0 - reserve) * params.thrust_max,
            )
        return RateDynamics(params)
    if reserve:
        raise ValueError(
            f"--reserve: expected 0 for --model rotors, got {reserve:g}: take --model rates"
        )
    if vehicle.rotors is None:
        raise ValueError(f"--model: {vehicle.name} has no rotors: take rates")
    return RotorDynamics(vehicle, vehicle.rotors)


class RotorDynamics(Dynamics):
    """The dynamics of a vehicle with its four rotors.

    The control u has the commanded rotor speeds [rad/s]. Without rotor lag it has the rotor thrusts
    [N], and the state has no rotor speeds.
    """

    name = "rotors"

    def __init__(self, vehicle: Vehicle, rotors: Rotors):
        """Prepare the dynamics of a vehicle with rotors."""
        self._vehicle = vehicle
        self._rotors = rotors
        self._mixer = mixer(rotors)
        self._lags = rotors.motor_tau > 0.0
        self._weakest = max(0.0, rotors.thrust(rotors.motor_omega_min))
        self._strongest = rotors.thrust(rotors.motor_omega_max)
        if self._lags:
            idle = rotors.speed(self._weakest)
            full = rotors.motor_omega_max
        else:
            idle = self._weakest
            full = self._strongest
        self.u_low = np.full(4, idle)
        self.u_high = np.full(4, full)
        body = _body_limits(vehicle.omega_max)
        self.low = np.append(-body, self.u_low if self._lags else [])
        self.high = np.append(body, self.u_high if self._lags else [])

    def rate(self, x: Any, u: Any) -> tuple:
        """Return the derivative x' at (x, u)."""
        vehicle = self._vehicle
        v = x[VELOCITY]
        q = x[ATTITUDE]
        omega = x[BODY_RATES]
        speeds = x[ROTOR_SPEEDS]

        # Force along the body's z axis and torque about its axes
        thrusts = tuple(map(self._rotors.thrust, speeds)) if self._lags else u
        t0, t1, t2, t3 = thrusts
        force, *torque = (a * t0 + b * t1 + c * t2 + d * t3 for a, b, c, d in self._mixer)

        # Drag is linear in the body's axes
        dx, dy, dz = (-d * w for d, w in zip(vehicle.drag, to_body(q, v), strict=True))
        ax, ay, az = to_world(q, (dx, dy, dz + force / vehicle.mass))

        turning = gyroscopic(omega, vehicle.inertia)
        spin = [
            (t - g) / inertia
            for t, g, inertia in zip(torque, turning, vehicle.inertia, strict=True)
        ]
        lag = []
        if self._lags:
            tau = self._rotors.motor_tau
            lag = [(command - w) / tau for command, w in zip(u, speeds, strict=True)]
        # q' = q x (0, omega) / 2
        turn = quaternion_rate(q, tuple(0.5 * w for w in omega))
        return (*v, ax, ay, az - GRAVITY, *turn, *spin, *lag)

    def fine(self, x: Any, u: Any, dt: float) -> Iterator[tuple]:
        """Yield the states within dt [s], the last one after dt."""
        steps = ceil(dt / FINE_RUNGE_KUTTA)
        for _ in range(steps):
            x = runge_kutta(self.rate, x, u, dt / steps)
            yield x

    def of_flight(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return x and u with the same motion and the thrust shared equally by the rotors."""
        share = 0.25 * self._vehicle.mass * state.thrust
        each = float(np.clip(share, self._weakest, self._strongest))
        u = np.full(4, self._rotors.speed(each) if self._lags else each)
        body = np.array(state)[RIGID_BODY]
        return np.append(body, u if self._lags else []), u


class RateDynamics(Dynamics):
    """The planner's model.

    The control u is a Control, limited such that the rotors have enough thrust for torques and
    `step` never clips. Without rotor lag, thrust and angular acceleration follow commands at once
    and are not part of the state.
    """

    name = "rates"

    def __init__(self, model: ModelParams):
        """Prepare the dynamics of the planner's model.

        Raises:
            ValueError: the body rates of the model have no lag.
        """
        if min(model.rate_tau) <= 0.0:
            raise ValueError(
                "--model: rates needs a vehicle whose body rates lag (rate_tau > 0): take rotors"
            )
        self._model = model
        self._n = BODY + 4 if model.motor_tau > 0.0 else BODY
        roll, pitch, yaw = model.rate_max
        body = _body_limits(model.rate_max)
        self.low = np.append(-body, [model.thrust_min, *[-SPIN_UP_MAX] * 3])[: self._n]
        self.high = np.append(body, [model.thrust_max, *[SPIN_UP_MAX] * 3])[: self._n]
        self.u_low = np.array(Control(-roll, -pitch, -yaw, model.thrust_min))
        self.u_high = np.array(Control(roll, pitch, yaw, model.thrust_max))

    def rate(self, x: Any, u: Any) -> tuple:
        """Return x' = d step / d dt at dt = 0, without clipping."""
        model = self._model
        dt = casadi.SX.sym("dt")
        follow = _response(dt, model.motor_tau)
        tau_x, tau_y, tau_z = model.rate_tau
        spin_x, spin_y, spin_z = (_response(dt, lag) for lag in model.rate_lags)
        p = Params(
            rate_gain_x=1.0 / tau_x,
            rate_gain_y=1.0 / tau_y,
            rate_gain_z=1.0 / tau_z,
            rotor_response=follow,
            rate_response_x=spin_x,
            rate_response_y=spin_y,
            rate_response_z=spin_z,
            thrust_gain=model.thrust_gain,
            drag=model.drag,
            tilt_cost_x=0.0,
            tilt_cost_y=0.0,
            yaw_per_room=UNLIMITED_YAW,
            yaw_reserve=0.0,
            thrust_max=2 * model.thrust_max,
        )
        ahead = casadi.vertcat(*step(_whole(x), Control(*u), p, dt)[: self._n])
        slope = casadi.substitute(casadi.jacobian(ahead, dt), dt, 0.0)
        return tuple(casadi.vertsplit(slope))

    def spare(self, x: Any, u: Any) -> tuple:
        """Return the thrust's distances from both limits, less the torques' reserve [m/s^2]."""
        model = self._model
        now = _whole(x)
        command = Control(*u)
        tau_x, tau_y, _ = model.rate_tau
        roll = (command.wx - now.wx) / tau_x
        pitch = (command.wy - now.wy) / tau_y
        # |roll| and |pitch| as one constraint for each combination of signs, which is smooth
        needs = [
            a * model.tilt_cost[0] * roll + b * model.tilt_cost[1] * pitch
            for a, b in product((1, -1), repeat=2)
        ]
        above = [model.thrust_max - command.thrust - need for need in needs]
        below = [command.thrust - model.thrust_min - need for need in needs]
        return (*above, *below)

    def fine(self, x: Any, u: Any, dt: float) -> Iterator[tuple]:
        """Yield the states within dt [s], the last one after dt."""
        steps = ceil(dt / FINE_STEP)
        system = quadrotor(self._model, dt / steps)
        state = _whole(x)
        for _ in range(steps):
            state = system.next(state, u)
            yield state[: self._n]

    def of_flight(self, state: State) -> tuple[np.ndarray, np.ndarray]:
        """Return x and u with the same motion, without angular acceleration."""
        limits = np.array(self._model.rate_max)
        rates = np.clip(state.body_rates, -limits, limits)
        u = Control(*rates, thrust=state.thrust)
        x = state._replace(bx=0.0, by=0.0, bz=0.0)
        return np.array(x)[: self._n], np.array(u)


def runge_kutta(rate: Callable[[Any, Any], tuple], x: Any, u: Any, h: Any) -> tuple:
    """Return x after h [s] under a constant u, by one step of the classical Runge-Kutta method."""
    k1 = rate(x, u)
    k2 = rate(_plus(x, 0.5 * h, k1), u)
    k3 = rate(_plus(x, 0.5 * h, k2), u)
    k4 = rate(_plus(x, h, k3), u)
    slopes = tuple(a + 2 * (b + c) + d for a, b, c, d in zip(k1, k2, k3, k4, strict=True))
    return _plus(x, h / 6, slopes)


def _plus(x: Any, h: Any, rate: tuple) -> tuple:
    return tuple(y + h * r for y, r in zip(x, rate, strict=True))


def _whole(x: Any) -> State:
    """Return the full state, with zeros for fields that exist only with rotor lag."""
    missing = len(State._fields) - len(x)
    return State(*x, *(0.0,) * missing)


def _body_limits(rate_max: tuple[float, ...]) -> np.ndarray:
    """Return the upper limits of position, velocity, attitude and body rates.  (13,)"""
    return np.array([np.inf] * 6 + [1.0] * 4 + [*rate_max])


def _response(dt: Any, lag: float) -> Any:
    """Return the share of the step to its command that a lagging quantity makes in dt [s]."""
    return dt / lag if lag > 0.0 else 1.0
