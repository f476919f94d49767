"""An off-road vehicle on flat ground: a simulated stand-in for the paper's hardware, not a model of it.

    steer' = clip((steer_cmd - steer) / tau_s, +-rate)      the steering wheel: lag, and about 2 s lock to lock
    drive' = (drive_cmd - drive) / tau_d                    throttle (> 0) and brake (< 0) in one
    v' = a_x,  a_x = (accel or brake) drive - drag v        never backwards
    a_y = clip(v^2 kappa steer, +-sqrt(grip^2 - a_x^2))     what the tyres give
    r' = (a_y / v - r) / tau_r                              yaw rate
    p' = v (heading turned by -slip v r)                    tyres run beside their heading

A bicycle whose tyres saturate. The heading is a unit vector, so that no step needs a sine.
"""

from __future__ import annotations

from dataclasses import dataclass

from numpy import maximum, minimum, sqrt, where

from quadsim.systems import System
from quadsim.systems.first_order import response

STATE_UNITS = {"px": "m", "py": "m", "hx": "1", "hy": "1", "v": "m/s", "r": "rad/s", "steer": "1", "drive": "1"}
CONTROL_UNITS = {"drive_cmd": "1", "steer_cmd": "1"}  # both in -1..1
DISTURBANCE = {"hx": 0.01, "hy": 0.01, "v": 0.2, "r": 0.04}  # standard deviation after 1 s of it [1, m/s, rad/s]


def step(x, u, p, dt):
    """x, u: STATE_UNITS and CONTROL_UNITS. p: OffroadVehicle's numbers, lags as gains in one dt."""
    px, py, hx, hy, v, r, steer, drive = x
    drive_cmd, steer_cmd = u
    k_steer, rate, k_drive, accel, brake, drag, kappa, grip, k_yaw, slip = p
    turned = rate * dt
    steer2 = steer + minimum(maximum((steer_cmd - steer) * k_steer, -turned), turned)
    drive2 = drive + (drive_cmd - drive) * k_drive
    ax = where(drive2 > 0.0, accel, brake) * drive2 - drag * v
    v2 = maximum(v + ax * dt, 0.0)
    room = sqrt(maximum(grip * grip - ax * ax, 1.0))
    ay = minimum(maximum(v2 * v2 * kappa * steer2, -room), room)
    r2 = r + (ay / maximum(v2, 0.1) - r) * k_yaw
    turn = 0.5 * (r + r2) * dt
    hx2, hy2 = hx - hy * turn, hy + hx * turn
    n = 1.5 - 0.5 * (hx2 * hx2 + hy2 * hy2)  # one Newton step on 1 / |h|
    hx2, hy2 = hx2 * n, hy2 * n
    beta, way = slip * v2 * r2, 0.5 * (v + v2) * dt
    return px + (hx2 + beta * hy2) * way, py + (hy2 - beta * hx2) * way, hx2, hy2, v2, r2, steer2, drive2


@dataclass(frozen=True)
class OffroadVehicle:
    """A side-by-side vehicle of about 3 m; plausible numbers, not measured."""

    name: str = "side_by_side"
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

    def params(self, dt: float) -> tuple[float, ...]:
        """For steps of dt [s]."""
        k_steer, k_drive, k_yaw = (response(tau, dt) for tau in (self.steer_tau, self.drive_tau, self.yaw_tau))
        force = (self.accel, self.brake, self.drag, self.curvature, self.grip)
        return (k_steer, self.steer_rate, k_drive, *force, k_yaw, self.slip)


# The vehicle that is driven responds more slowly, slides, and grips less than the planner's nominal model.
NOMINAL = OffroadVehicle()
DRIVEN = OffroadVehicle(
    steer_tau=0.2, steer_rate=0.95, drive_tau=0.5, accel=3.2, curvature=0.17, grip=5.5, yaw_tau=0.2, slip=0.01
)


def offroad(vehicle: OffroadVehicle, dt: float) -> System:
    """The system at control period dt [s]."""
    return System(
        name="offroad",
        states=tuple(STATE_UNITS),
        controls=tuple(CONTROL_UNITS),
        step=step,
        params=vehicle.params(dt),
        dt=dt,
        low=(-1.0, -1.0),
        high=(1.0, 1.0),
        rest=(0.0, 0.0),
    )
