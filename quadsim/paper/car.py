"""An off-road vehicle on flat ground, which replaces the paper's vehicle but does not model it.

    steer' = clip((steer_cmd - steer) / tau_s, +-rate)      the steering wheel lags, and takes about
                                                            2 s from lock to lock
    drive' = (drive_cmd - drive) / tau_d                    throttle (> 0) and brake (< 0) in one
    v' = a_x,  a_x = (accel or brake) drive - drag v        the vehicle never rolls backwards
    a_y = clip(v^2 kappa steer, +-sqrt(grip^2 - a_x^2))     lateral acceleration, within the grip
    r' = (a_y / v - r) / tau_r                              yaw rate
    p' = v (heading turned by -slip v r)                    tyres with a sideslip

The model is a bicycle with saturated tyres. The heading is a unit vector, so a step needs no sine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy import maximum, minimum, sqrt, where

from quadsim.dynamics import System
from quadsim.dynamics.first_order import response


class CarState(NamedTuple):
    """Position, heading, speed, yaw rate, and the positions of steering wheel and pedals."""

    px: float  # [m]
    py: float  # [m]
    hx: float  # heading, a unit vector
    hy: float
    v: float  # [m/s]
    r: float  # [rad/s]
    steer: float
    drive: float


class CarControl(NamedTuple):
    """Throttle (> 0) or brake (< 0), and steering, both in -1..1."""

    drive_cmd: float
    steer_cmd: float


class CarParams(NamedTuple):
    """The parameters of `step`: the parameters of OffroadVehicle, with a response for each lag.

    A response is the share of the difference to its command that a state makes up in one step.
    """

    steer_response: float
    steer_rate: float  # [1/s]
    drive_response: float
    accel: float  # [m/s^2]
    brake: float  # [m/s^2]
    drag: float  # [1/s]
    curvature: float  # [1/m]
    grip: float  # [m/s^2]
    yaw_response: float
    slip: float  # [rad s^2/m]


def step(x, u, p, dt):
    """Return the state after dt [s] from the state x under the control u, with parameters p."""
    # Steering wheel and pedals lag behind their commands.
    turned = p.steer_rate * dt
    steer = x.steer + minimum(maximum((u.steer_cmd - x.steer) * p.steer_response, -turned), turned)
    drive = x.drive + (u.drive_cmd - x.drive) * p.drive_response

    # Longitudinal: throttle, brake and drag; the vehicle never rolls back.
    ax = where(drive > 0.0, p.accel, p.brake) * drive - p.drag * x.v
    v = maximum(x.v + ax * dt, 0.0)

    # Lateral: the remaining grip of the tyres.
    most = sqrt(maximum(p.grip * p.grip - ax * ax, 1.0))
    ay = minimum(maximum(v * v * p.curvature * steer, -most), most)
    r = x.r + (ay / maximum(v, 0.1) - x.r) * p.yaw_response

    # The heading turns; one Newton step on 1 / |h| renormalises.
    turn = 0.5 * (x.r + r) * dt
    hx = x.hx - x.hy * turn
    hy = x.hy + x.hx * turn
    scale = 1.5 - 0.5 * (hx * hx + hy * hy)
    hx = hx * scale
    hy = hy * scale

    # The velocity differs from the heading by the sideslip.
    beta = p.slip * v * r
    travelled = 0.5 * (x.v + v) * dt
    return CarState(
        px=x.px + (hx + beta * hy) * travelled,
        py=x.py + (hy - beta * hx) * travelled,
        hx=hx,
        hy=hy,
        v=v,
        r=r,
        steer=steer,
        drive=drive,
    )


@dataclass(frozen=True)
class OffroadVehicle:
    """A side-by-side vehicle of about 3 m; its numbers are plausible, not measured."""

    half_width: float = 0.8  # [m]
    steer_tau: float = 0.15  # lag of the steering wheel [s]
    steer_rate: float = 1.0  # of the steering wheel [1/s]
    drive_tau: float = 0.4  # lag of throttle and brake [s]
    accel: float = 3.5  # at full throttle [m/s^2]
    brake: float = 6.0  # at full brake [m/s^2]
    drag: float = 0.15  # [1/s]
    curvature: float = 0.18  # at full lock, without slip [1/m]
    grip: float = 6.0  # of the tyres, in any direction [m/s^2]
    yaw_tau: float = 0.15  # lag of the yaw rate [s]
    slip: float = 0.0  # sideslip per lateral acceleration [rad s^2/m]

    def params(self, dt: float) -> CarParams:
        """Return the parameters of `step` for steps of dt [s]."""
        return CarParams(
            steer_response=response(self.steer_tau, dt),
            steer_rate=self.steer_rate,
            drive_response=response(self.drive_tau, dt),
            accel=self.accel,
            brake=self.brake,
            drag=self.drag,
            curvature=self.curvature,
            grip=self.grip,
            yaw_response=response(self.yaw_tau, dt),
            slip=self.slip,
        )


# The planner's model.
NOMINAL = OffroadVehicle()
# The driven vehicle responds more slowly, slides, and has less grip.
DRIVEN = OffroadVehicle(
    steer_tau=0.2,
    steer_rate=0.95,
    drive_tau=0.5,
    accel=3.2,
    curvature=0.17,
    grip=5.5,
    yaw_tau=0.2,
    slip=0.01,
)
# Standard deviations of the random disturbance accumulated over 1 s.
DISTURBANCE = CarState(px=0.0, py=0.0, hx=0.01, hy=0.01, v=0.2, r=0.04, steer=0.0, drive=0.0)


def car(vehicle: OffroadVehicle, dt: float) -> System:
    """Return the system of a vehicle in steps of dt [s]."""
    return System(
        name="offroad",
        state=CarState,
        control=CarControl,
        step=step,
        params=vehicle.params(dt),
        dt=dt,
        low=CarControl(-1.0, -1.0),
        high=CarControl(1.0, 1.0),
        rest=CarControl(0.0, 0.0),
    )


def disturbed(
    x: CarState, dt: float, rng: np.random.Generator, std: CarState = DISTURBANCE
) -> CarState:
    """Return the state after the Brownian disturbance of one step of dt [s].

    Each number changes by std sqrt(dt) N(0, 1), which accumulates to std after 1 s for any dt.
    """
    scale = np.array(std) * np.sqrt(dt)
    moved = np.array(x) + scale * rng.standard_normal(len(scale))
    return CarState(*moved.tolist())
