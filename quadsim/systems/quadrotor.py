"""The quadrotor that MPPI believes in: rigid attitude, first-order body rates and thrust, linear drag.

    p' = v
    v' = R(q) e_z a - g e_z - d v
    q' = q x (0, omega) / 2
    omega' = (omega_cmd - omega) / tau_omega
    a' = (a_cmd - a) / tau_a

The 13 states of Vlahov et al. 2024, section IV-B, and a 14th, the mass-normalised thrust the rotors
deliver now. With tau_a = 0 (the paper's model) it equals the command at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import Annotated

from quadsim.plant import CONTROL, STATE
from quadsim.strict_yaml import unit
from quadsim.systems import System
from quadsim.vehicle import GRAVITY, Vehicle


def step(x, u, p, dt):
    """x, u: plant.STATE and plant.CONTROL. p: gains of rates (3) and thrust in one dt, drag [1/s]."""
    px, py, pz, vx, vy, vz, qw, qx, qy, qz, wx, wy, wz, a = x
    wx_cmd, wy_cmd, wz_cmd, a_cmd = u
    k_x, k_y, k_z, k_a, drag = p
    half = 0.5 * dt
    a2 = a + (a_cmd - a) * k_a
    wx2 = wx + (wx_cmd - wx) * k_x
    wy2 = wy + (wy_cmd - wy) * k_y
    wz2 = wz + (wz_cmd - wz) * k_z
    # q' = q x (0, omega) / 2; one Newton step on 1/|q| renormalises to O(dt^4)
    qw2 = qw - half * (qx * wx2 + qy * wy2 + qz * wz2)
    qx2 = qx + half * (qw * wx2 + qy * wz2 - qz * wy2)
    qy2 = qy + half * (qw * wy2 - qx * wz2 + qz * wx2)
    qz2 = qz + half * (qw * wz2 + qx * wy2 - qy * wx2)
    unit = 1.5 - 0.5 * (qw2 * qw2 + qx2 * qx2 + qy2 * qy2 + qz2 * qz2)
    # thrust acts along the body's z axis, R(q) e_z
    ax = 2.0 * (qx * qz + qw * qy) * a2 - drag * vx
    ay = 2.0 * (qy * qz - qw * qx) * a2 - drag * vy
    az = (1.0 - 2.0 * (qx * qx + qy * qy)) * a2 - drag * vz - GRAVITY
    vx2 = vx + ax * dt
    vy2 = vy + ay * dt
    vz2 = vz + az * dt
    return (
        px + (vx + vx2) * half,  # the mean velocity: exact where the acceleration is constant
        py + (vy + vy2) * half,
        pz + (vz + vz2) * half,
        vx2,
        vy2,
        vz2,
        qw2 * unit,
        qx2 * unit,
        qy2 * unit,
        qz2 * unit,
        wx2,
        wy2,
        wz2,
        a2,
    )


Lag = Annotated[float, unit("s", ge=0, le=10)]
Rate = Annotated[float, unit("rad/s", gt=0, le=100)]


@dataclass(frozen=True)
class Belief:
    """The numbers MPPI plans with. Plant and belief may differ; a run stores both."""

    rate_tau: tuple[Lag, Lag, Lag]  # lag of the body rates about x, y, z [s]
    thrust_tau: Lag  # lag of the thrust [s]; 0: it follows its command at once
    drag: Annotated[float, unit("1/s", ge=0, le=20)]  # linear, isotropic [1/s]
    rate_max: tuple[Rate, Rate, Rate]  # limit of the body-rate commands [rad/s]
    thrust_max: Annotated[float, unit("m/s^2", gt=GRAVITY, le=1000)]  # mass-normalised limit [m/s^2]
    thrust_min: Annotated[float, unit("m/s^2", ge=0, lt=GRAVITY)] = 0.0

    @classmethod
    def of(cls, vehicle: Vehicle) -> Belief:
        """What a careful engineer would measure on this vehicle: everything but the axis ratio of the drag."""
        rotors = vehicle.rotors
        return cls(
            rate_tau=vehicle.rate_tau,
            thrust_tau=rotors.tau if rotors else 0.0,
            drag=sum(vehicle.drag) / 3,
            rate_max=vehicle.rate_max,
            thrust_max=vehicle.thrust_max,
        )


def gain(tau: float, dt: float) -> float:
    """Share of a first-order step done after dt: 1 - exp(-dt / tau), all of it for tau = 0."""
    return 1.0 - exp(-dt / tau) if tau > 0 else 1.0


def quadrotor(belief: Belief, dt: float) -> System:
    """The system MPPI plans with, at control period dt [s]."""
    return System(
        name="quadrotor",
        states=STATE,
        controls=CONTROL,
        step=step,
        params=(*(gain(tau, dt) for tau in (*belief.rate_tau, belief.thrust_tau)), belief.drag),
        dt=dt,
        low=(*(-r for r in belief.rate_max), belief.thrust_min),
        high=(*belief.rate_max, belief.thrust_max),
        rest=(0.0, 0.0, 0.0, GRAVITY),
    )
