"""x' = f(x, u) of a vehicle, for the optimiser and for the check of what it finds.

rotors   the vehicle as the plant flies it: four rotor speeds behind their lag, thrust map, mixer,
rigid body, drag rates    the planner's model: body rates and thrust behind first-order lags, by its
own `step`
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import ceil
from typing import Any

import casadi
import numpy as np

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
from quadsim.physics.actuators import gyroscopic
from quadsim.physics.allocation import mixer
from quadsim.rotation import quaternion_rate, to_body, to_world
from quadsim.vehicle import GRAVITY, Rotors, Vehicle

# CasADi 3.8 warns until it is told what to make of
if hasattr(casadi.GlobalOptions, "setNumpyMode"):
    casadi.GlobalOptions.setNumpyMode(-1)  # the numpy functions in `step`: CasADi's own, as always

# Every state begins with the RIGID_BODY of State. Where rotors lag, their four speeds follow, or
# what they deliver.
BODY = RIGID_BODY.stop  # how many numbers the rigid body has
ROTOR_SPEEDS = slice(BODY, BODY + 4)
SPIN_UP_MAX = 1000.0  # [rad/s^2] of the body, beyond what any vehicle reaches
# [rad/s] of a race to be flown: rotors near full thrust cannot yaw, which this problem leaves out
YAW_MAX = 0.5
# longest step of the check, by Runge-Kutta and by the planner's step, of order 1 [s]
FINE = 1e-3, 2e-4


@dataclass(frozen=True)
class Dynamics:
    """A model as the optimiser sees it; x and u are tuples of scalars, or of rows of numbers."""

    name: str
    rate: Callable[[Any, Any], tuple]  # x' of (x, u)
    low: np.ndarray  # (n_x,) limits of the state; those of position and velocity are the task's
    high: np.ndarray
    u_low: np.ndarray  # (n_u,)
    u_high: np.ndarray
    # x, u of the same motion and thrust
    of_flight: Callable[[State], tuple[np.ndarray, np.ndarray]]
    # the states on the way, and at the end of so many seconds
    fine: Callable[[Any, Any, float], Iterator[tuple]]
    # of (x, u): what has to stay at or above 0
    spare: Callable[[Any, Any], tuple] = lambda x, u: ()


def dynamics(vehicle: Vehicle, model: str, reserve: float = 0.0) -> Dynamics:
    """reserve: share of the thrust that is left unused, for rates; then YAW_MAX holds too. Raises
    ValueError for a vehicle that the model does not cover."""
    if model == "rates":
        # YAW_MAX in its place: the problem stays smooth
        params = replace(ModelParams.of(vehicle), yaw_cost=0.0)
        if reserve:
            roll, pitch, yaw = params.rate_max
            thrust = (1.0 - reserve) * params.thrust_max
            params = replace(params, rate_max=(roll, pitch, min(yaw, YAW_MAX)), thrust_max=thrust)
        return rates(params)
    if reserve:
        raise ValueError(
            f"--reserve: expected 0 for --model rotors, got {reserve:g}: take --model rates"
        )
    if vehicle.rotors is None:
        raise ValueError(f"--model: {vehicle.name} has no rotors: take rates")
    return rotors(vehicle, vehicle.rotors)


def rotors(vehicle: Vehicle, r: Rotors) -> Dynamics:
    """u: commanded rotor speeds [rad/s], or thrusts [N] of rotors that follow at once and so have
    no states."""
    mass, inertia, mix = vehicle.mass, vehicle.inertia, mixer(r)
    weakest, strongest = max(0.0, r.thrust(r.omega_min)), r.thrust(r.omega_max)
    lags = r.tau > 0.0
    idle, full = (r.speed(weakest), r.omega_max) if lags else (weakest, strongest)

    def rate(x, u):
        v, q, omega = x[VELOCITY], x[ATTITUDE], x[BODY_RATES]
        speeds = x[ROTOR_SPEEDS]
        thrusts = tuple(map(r.thrust, speeds)) if lags else u
        force, *torque = (
            a * thrusts[0] + b * thrusts[1] + c * thrusts[2] + d * thrusts[3] for a, b, c, d in mix
        )
        dx, dy, dz = (-d * b for d, b in zip(vehicle.drag, to_body(q, v), strict=True))
        ax, ay, az = to_world(q, (dx, dy, dz + force / mass))
        spin = (
            (t - g) / j for t, g, j in zip(torque, gyroscopic(omega, inertia), inertia, strict=True)
        )
        lag = ((c - w) / r.tau for c, w in zip(u, speeds, strict=True)) if lags else ()
        return (*v, ax, ay, az - GRAVITY, *_turn(q, omega), *spin, *lag)

    def of_flight(state: State):
        each = float(np.clip(0.25 * mass * state.thrust, weakest, strongest))
        u = np.full(4, r.speed(each) if lags else each)
        body = np.array(state)[RIGID_BODY]
        return np.append(body, u if lags else []), u

    def fine(x, u, dt):
        steps = ceil(dt / FINE[0])
        for _ in range(steps):
            x = runge_kutta(rate, x, u, dt / steps)
            yield x

    body, n = _body(vehicle.rate_max), 4 if lags else 0
    return Dynamics(
        name="rotors",
        rate=rate,
        low=np.append(-body, np.full(n, idle)),
        high=np.append(body, np.full(n, full)),
        u_low=np.full(4, idle),
        u_high=np.full(4, full),
        of_flight=of_flight,
        fine=fine,
    )


def rates(model: ModelParams) -> Dynamics:
    """u: CONTROL, within what leaves the rotors the thrust they need to turn, so that `step` never
    clips.

    Without rotor lag, thrust and angular acceleration follow at once and are no states.
    """
    tau, n = model.motor_tau, BODY + 4 if model.motor_tau > 0.0 else BODY
    if min(model.rate_tau) <= 0.0:
        raise ValueError(
            "--model: rates needs a vehicle whose body rates lag (rate_tau > 0): take rotors"
        )

    def whole(x) -> State:
        """Return the state with zeros for what is no state without rotor lag."""
        missing = len(State._fields) - len(x)
        return State(*x, *(0.0,) * missing)

    def rate(x, u):  # x' = d step / d dt at dt = 0, with a clip that never acts
        dt = casadi.SX.sym("dt")
        follow: Any = dt / tau if tau > 0.0 else 1.0
        tau_x, tau_y, tau_z = model.rate_tau
        p = Params(
            rate_gain_x=1.0 / tau_x,
            rate_gain_y=1.0 / tau_y,
            rate_gain_z=1.0 / tau_z,
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
        now, command = whole(x), Control(*u)
        tau_x, tau_y, _ = model.rate_tau
        cx = (command.wx - now.wx) / tau_x
        cy = (command.wy - now.wy) / tau_y
        reserves = [
            a * model.tilt_cost[0] * cx + b * model.tilt_cost[1] * cy
            for a, b in product((1, -1), repeat=2)
        ]
        above = [model.thrust_max - command.thrust - s for s in reserves]
        below = [command.thrust - model.thrust_min - s for s in reserves]
        return (*above, *below)

    def of_flight(state: State):
        limits = np.array(model.rate_max)
        u = Control(*np.clip(state.body_rates, -limits, limits), thrust=state.thrust)
        x = state._replace(bx=0.0, by=0.0, bz=0.0)
        return np.array(x)[:n], np.array(u)

    def fine(x, u, dt):
        steps = ceil(dt / FINE[1])
        system, state = quadrotor(model, dt / steps), whole(x)
        for _ in range(steps):
            state = system.next(state, u)
            yield state[:n]

    body = _body(model.rate_max)
    roll, pitch, yaw = model.rate_max
    return Dynamics(
        name="rates",
        rate=rate,
        low=np.append(-body, [model.thrust_min, *[-SPIN_UP_MAX] * 3])[:n],
        high=np.append(body, [model.thrust_max, *[SPIN_UP_MAX] * 3])[:n],
        u_low=np.array(Control(-roll, -pitch, -yaw, model.thrust_min)),
        u_high=np.array(Control(roll, pitch, yaw, model.thrust_max)),
        of_flight=of_flight,
        fine=fine,
        spare=spare,
    )


def runge_kutta(rate: Callable, x: Any, u: Any, h: Any) -> tuple:
    """x after h [s] under a constant u, by one step of the classical method of order 4."""
    a = rate(x, u)
    b = rate(_plus(x, 0.5 * h, a), u)
    c = rate(_plus(x, 0.5 * h, b), u)
    d = rate(_plus(x, h, c), u)
    return _plus(
        x, h / 6, tuple(k1 + 2 * (k2 + k3) + k4 for k1, k2, k3, k4 in zip(a, b, c, d, strict=True))
    )


def _plus(x: Any, h: Any, rate: tuple) -> tuple:
    return tuple(y + h * r for y, r in zip(x, rate, strict=True))


def _turn(q: Any, omega: Any) -> tuple:
    """q' = q x (0, omega) / 2."""
    return quaternion_rate(q, tuple(0.5 * w for w in omega))


def _body(rate_max: tuple[float, ...]) -> np.ndarray:
    """Greatest position, velocity, attitude, body rates.  (13,)"""
    return np.array([np.inf] * 6 + [1.0] * 4 + [*rate_max])
