"""x' = f(x, u) of a vehicle, for the optimiser and for the check of what it finds.

rotors   the vehicle as the plant flies it: four rotor speeds behind their lag, thrust map, mixer, rigid body, drag
rates    the planner's model: body rates and thrust behind first-order lags, by its own `step`
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import ceil
from typing import Any

import casadi
import numpy as np

from quadsim.physics.actuators import gyroscopic
from quadsim.physics.allocation import mixer
from quadsim.systems.quadrotor import (
    UNLIMITED_YAW,
    Control,
    ModelParams,
    Params,
    State,
    quadrotor,
    quaternion_rate,
    step,
)
from quadsim.systems.rotation import to_body, to_world
from quadsim.vehicle import GRAVITY, Rotors, Vehicle

if hasattr(casadi.GlobalOptions, "setNumpyMode"):  # CasADi 3.8 warns until it is told what to make of
    casadi.GlobalOptions.setNumpyMode(-1)  # the numpy functions in `step`: CasADi's own, as always

BODY = 13  # position, velocity, attitude (wxyz) and body rates come first in every state
SPIN_UP_MAX = 1000.0  # [rad/s^2] of the body, beyond what any vehicle reaches
YAW_MAX = 0.5  # [rad/s] of a race to be flown: rotors near full thrust cannot yaw, which this problem leaves out
FINE = 1e-3, 2e-4  # longest step of the check, by Runge-Kutta and by the planner's step, of order 1 [s]


@dataclass(frozen=True)
class Dynamics:
    """A model as the optimiser sees it; x and u are tuples of scalars, or of rows of numbers."""

    name: str
    rate: Callable[[Any, Any], tuple]  # x' of (x, u)
    low: np.ndarray  # (n_x,) limits of the state; those of position and velocity are the task's
    high: np.ndarray
    u_low: np.ndarray  # (n_u,)
    u_high: np.ndarray
    of_flight: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]  # STATE (17,) -> x, u of the same thrust
    fine: Callable[[Any, Any, float], Iterator[tuple]]  # the states on the way, and at the end of so many seconds
    spare: Callable[[Any, Any], tuple] = lambda x, u: ()  # of (x, u): what has to stay at or above 0


def dynamics(vehicle: Vehicle, model: str, reserve: float = 0.0) -> Dynamics:
    """reserve: share of the thrust that is left unused, for rates; then YAW_MAX holds too. Raises ValueError for a
    vehicle that the model does not cover."""
    if model == "rates":
        params = replace(ModelParams.of(vehicle), yaw_cost=0.0)  # YAW_MAX in its place: the problem stays smooth
        if reserve:
            roll, pitch, yaw = params.rate_max
            thrust = (1.0 - reserve) * params.thrust_max
            params = replace(params, rate_max=(roll, pitch, min(yaw, YAW_MAX)), thrust_max=thrust)
        return rates(params)
    if reserve:
        raise ValueError(f"--reserve: expected 0 for --model rotors, got {reserve:g}: take --model rates")
    if vehicle.rotors is None:
        raise ValueError(f"--model: {vehicle.name} has no rotors: take rates")
    return rotors(vehicle, vehicle.rotors)


def rotors(vehicle: Vehicle, r: Rotors) -> Dynamics:
    """u: commanded rotor speeds [rad/s], or thrusts [N] of rotors that follow at once and so have no states."""
    mass, inertia, mix = vehicle.mass, vehicle.inertia, mixer(r)
    weakest, strongest = max(0.0, r.thrust(r.omega_min)), r.thrust(r.omega_max)
    lags = r.tau > 0.0
    idle, full = (r.speed(weakest), r.omega_max) if lags else (weakest, strongest)

    def rate(x, u):
        v, q, omega, speeds = x[3:6], x[6:10], x[10:13], x[13:17]
        thrusts = tuple(map(r.thrust, speeds)) if lags else u
        force, *torque = (a * thrusts[0] + b * thrusts[1] + c * thrusts[2] + d * thrusts[3] for a, b, c, d in mix)
        dx, dy, dz = (-d * b for d, b in zip(vehicle.drag, to_body(q, v), strict=True))
        ax, ay, az = to_world(q, (dx, dy, dz + force / mass))
        spin = ((t - g) / j for t, g, j in zip(torque, gyroscopic(omega, inertia), inertia, strict=True))
        lag = ((c - w) / r.tau for c, w in zip(u, speeds, strict=True)) if lags else ()
        return (*v, ax, ay, az - GRAVITY, *_turn(q, omega), *spin, *lag)

    def of_flight(state):
        each = float(np.clip(0.25 * mass * state[13], weakest, strongest))
        u = np.full(4, r.speed(each) if lags else each)
        return np.append(state[:BODY], u if lags else []), u

    def fine(x, u, dt):
        steps = ceil(dt / FINE[0])
        for _ in range(steps):
            x = runge_kutta(rate, x, u, dt / steps)
            yield x

    body, n = _body(vehicle.rate_max), 4 if lags else 0
    low, high = np.append(-body, np.full(n, idle)), np.append(body, np.full(n, full))
    return Dynamics("rotors", rate, low, high, np.full(4, idle), np.full(4, full), of_flight, fine)


def rates(model: ModelParams) -> Dynamics:
    """u: CONTROL, within what leaves the rotors the thrust they need to turn, so that `step` never clips.

    Without rotor lag, thrust and angular acceleration follow at once and are no states.
    """
    tau, n = model.motor_tau, BODY + 4 if model.motor_tau > 0.0 else BODY
    if min(model.rate_tau) <= 0.0:
        raise ValueError("--model: rates needs a vehicle whose body rates lag (rate_tau > 0): take rotors")

    def whole(x):
        return State(*(*x, 0.0, 0.0, 0.0, 0.0)[: BODY + 4])

    def rate(x, u):  # x' = d step / d dt at dt = 0, with a clip that never acts
        dt = casadi.SX.sym("dt")
        follow: Any = dt / tau if tau > 0.0 else 1.0
        gain_x, gain_y, gain_z = (1.0 / tau_rate for tau_rate in model.rate_tau)
        p = Params(
            rate_gain_x=gain_x,
            rate_gain_y=gain_y,
            rate_gain_z=gain_z,
            rotor_response=follow,
            thrust_gain=model.thrust_gain,
            drag=model.drag,
            tilt_cost_x=0.0,
            tilt_cost_y=0.0,
            yaw_per_room=UNLIMITED_YAW,
            thrust_max=2 * model.thrust_max,
        )
        ahead = casadi.vertcat(*step(whole(x), Control(*u), p, dt)[:n])
        return tuple(casadi.vertsplit(casadi.substitute(casadi.jacobian(ahead, dt), dt, 0.0)))

    def spare(x, u):
        cx, cy = ((c - w) / t for c, w, t in zip(u[:2], x[10:12], model.rate_tau[:2], strict=True))
        reserves = [a * model.tilt_cost[0] * cx + b * model.tilt_cost[1] * cy for a, b in product((1, -1), repeat=2)]
        return (*(model.thrust_max - u[3] - s for s in reserves), *(u[3] - model.thrust_min - s for s in reserves))

    def of_flight(state):
        u = np.append(np.clip(state[10:13], -np.array(model.rate_max), model.rate_max), state[13])
        return np.append(state[:14], np.zeros(3))[:n], u

    def fine(x, u, dt):
        steps = ceil(dt / FINE[1])
        system, state = quadrotor(model, dt / steps), whole(x)
        for _ in range(steps):
            state = system.next(state, u)
            yield state[:n]

    body = _body(model.rate_max)
    low = np.append(-body, [model.thrust_min, *[-SPIN_UP_MAX] * 3])[:n]
    high = np.append(body, [model.thrust_max, *[SPIN_UP_MAX] * 3])[:n]
    u_high = np.array([*model.rate_max, model.thrust_max])
    u_low = np.append(-u_high[:3], model.thrust_min)
    return Dynamics("rates", rate, low, high, u_low, u_high, of_flight, fine, spare)


def runge_kutta(rate: Callable, x: Any, u: Any, h: Any) -> tuple:
    """x after h [s] under a constant u, by one step of the classical method of order 4."""
    a = rate(x, u)
    b = rate(_plus(x, 0.5 * h, a), u)
    c = rate(_plus(x, 0.5 * h, b), u)
    d = rate(_plus(x, h, c), u)
    return _plus(x, h / 6, tuple(k1 + 2 * (k2 + k3) + k4 for k1, k2, k3, k4 in zip(a, b, c, d, strict=True)))


def _plus(x: Any, h: Any, rate: tuple) -> tuple:
    return tuple(y + h * r for y, r in zip(x, rate, strict=True))


def _turn(q: Any, omega: Any) -> tuple:
    """q' = q x (0, omega) / 2."""
    return quaternion_rate(q, tuple(0.5 * w for w in omega))


def _body(rate_max: tuple[float, ...]) -> np.ndarray:
    """Greatest position, velocity, attitude, body rates.  (13,)"""
    return np.array([np.inf] * 6 + [1.0] * 4 + [*rate_max])
