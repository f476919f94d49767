"""The quadrotor that MPPI plans with: first-order body rates behind rotors that lag, linear drag.

    p' = v
    v' = k R(q) e_z a - g e_z - d v
    q' = q x (0, omega) / 2
    omega' = beta
    beta' = (beta_cmd - beta) / tau_m,                  beta_cmd = (omega_cmd - omega) / tau_omega
    a' = (a_lim - a) / tau_m,                           a_lim = clip(a_cmd, r, a_max - r)
    r = c_x |beta_cmd,x| + c_y |beta_cmd,y|,            |beta_cmd,z| <= (min(a_lim, a_max - a_lim) - r) / c_z

The 13 states of Vlahov et al. 2024, section IV-B, and four more, what the rotors deliver now: thrust a
and angular acceleration beta. To roll or pitch, two rotors give up the thrust r that the others, at their limit, cannot
add. Yaw has what is left then: two rotors speed up, two slow down, and at full thrust none can. The plant's allocation
has the same order (quadsim.physics.allocation). With tau_m = c = 0, the paper's model, thrust and rates' accelerations
follow their commands at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

from msgspec import Meta
from numpy import maximum, minimum

from quadsim.files.strict_yaml import unit
from quadsim.rotation import Quaternion, Vec3, quaternion_rate
from quadsim.systems import System, units_of
from quadsim.systems.first_order import response
from quadsim.vehicle import GRAVITY, Vehicle


class State(NamedTuple):
    """What the quadrotor does now. Position and velocity in the world (ENU), rates and accelerations in the body.

    Every table of the project takes the order of these names: telemetry, the compiled lanes, the optimiser.
    """

    px: Annotated[float, "m"]
    py: Annotated[float, "m"]
    pz: Annotated[float, "m"]
    vx: Annotated[float, "m/s"]
    vy: Annotated[float, "m/s"]
    vz: Annotated[float, "m/s"]
    qw: Annotated[float, "1"]
    qx: Annotated[float, "1"]
    qy: Annotated[float, "1"]
    qz: Annotated[float, "1"]
    wx: Annotated[float, "rad/s"]
    wy: Annotated[float, "rad/s"]
    wz: Annotated[float, "rad/s"]
    thrust: Annotated[float, "m/s^2"]  # mass-normalised, what the rotors deliver now
    bx: Annotated[float, "rad/s^2"]  # angular acceleration that the rotors deliver now
    by: Annotated[float, "rad/s^2"]
    bz: Annotated[float, "rad/s^2"]

    @property
    def position(self) -> Vec3:
        """In the world [m]."""
        return self.px, self.py, self.pz

    @property
    def velocity(self) -> Vec3:
        """In the world [m/s]."""
        return self.vx, self.vy, self.vz

    @property
    def attitude(self) -> Quaternion:
        """Unit quaternion wxyz, world from body."""
        return self.qw, self.qx, self.qy, self.qz

    @property
    def body_rates(self) -> Vec3:
        """About the body's axes [rad/s]."""
        return self.wx, self.wy, self.wz

    @property
    def angular_acceleration(self) -> Vec3:
        """About the body's axes [rad/s^2]."""
        return self.bx, self.by, self.bz

    @classmethod
    def of(
        cls,
        position: Sequence[float],
        velocity: Sequence[float],
        attitude: Sequence[float],
        body_rates: Sequence[float],
        thrust: float,
        angular_acceleration: Sequence[float],
    ) -> State:
        """Put a state together from its vectors, named as the properties above."""
        return cls._make((*position, *velocity, *attitude, *body_rates, thrust, *angular_acceleration))


class Control(NamedTuple):
    """What the flight controller is commanded."""

    wx: Annotated[float, "rad/s"]
    wy: Annotated[float, "rad/s"]
    wz: Annotated[float, "rad/s"]
    thrust: Annotated[float, "m/s^2"]  # mass-normalised

    @property
    def body_rates(self) -> Vec3:
        """About the body's axes [rad/s]."""
        return self.wx, self.wy, self.wz


# Columns of telemetry: the names above, but for two that are written as symbols there.
STATE_UNITS = {("a" if name == "thrust" else name): unit for name, unit in units_of(State).items()}
CONTROL_UNITS = {("a_cmd" if name == "thrust" else f"{name}_cmd"): unit for name, unit in units_of(Control).items()}
STATE, CONTROL = tuple(STATE_UNITS), tuple(CONTROL_UNITS)


def columns(first: str, last: str) -> slice:
    """Return where the numbers from one field of State to another stand in rows of states, e.g. x[:, POSITION]."""
    return slice(State._fields.index(first), State._fields.index(last) + 1)


# For tables of states and for the optimiser's vectors; a single State has properties of these names.
POSITION = columns("px", "pz")
VELOCITY = columns("vx", "vz")
ATTITUDE = columns("qw", "qz")
BODY_RATES = columns("wx", "wz")
POSE = columns("px", "qz")  # position, velocity and attitude: what is shown of a vehicle
RIGID_BODY = columns("px", "wz")  # all but what the rotors deliver

LEAST_ROOM = 1e-3  # [m/s^2] of thrust is always left for yaw, so that UNLIMITED_YAW is without limit at full thrust too
UNLIMITED_YAW = 1e9  # [1/m] 1 / c_z of a vehicle without rotors


def thrust_axis(qw, qx, qy, qz):
    """R(q) e_z: the body's z axis, along which the thrust acts, in the world.  (3,)"""
    return 2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy)


def tilt_reserve(c_x, c_y, bx, by):
    """r = c_x |beta_x| + c_y |beta_y|: the thrust kept free for these angular accelerations [m/s^2]."""
    return c_x * abs(bx) + c_y * abs(by)


def step(x, u, p, dt):
    """x, u: STATE and CONTROL.

    p: gains of the rates (3) [1/s], response of the rotors in one dt, k, drag d [1/s], c_x, c_y [m], 1 / c_z [1/m],
    a_max [m/s^2].
    """
    px, py, pz, vx, vy, vz, qw, qx, qy, qz, wx, wy, wz, a, bx, by, bz = x
    wx_cmd, wy_cmd, wz_cmd, a_cmd = u
    k_x, k_y, k_z, k_m, k, drag, c_x, c_y, per_c_z, a_max = p
    half, eighth = 0.5 * dt, 0.125 * dt
    # what the rotors deliver moves towards the command, as far as their limits allow: roll and pitch first, yaw last
    bx_cmd, by_cmd, bz_cmd = (wx_cmd - wx) * k_x, (wy_cmd - wy) * k_y, (wz_cmd - wz) * k_z
    reserve = tilt_reserve(c_x, c_y, bx_cmd, by_cmd)
    most = a_max - reserve
    a_lim = minimum(maximum(a_cmd, reserve), most)
    bz_max = (maximum(minimum(a_lim - reserve, most - a_lim), 0.0) + LEAST_ROOM) * per_c_z
    bz_cmd = minimum(maximum(bz_cmd, -bz_max), bz_max)
    a2 = a + (a_lim - a) * k_m
    bx2, by2, bz2 = bx + (bx_cmd - bx) * k_m, by + (by_cmd - by) * k_m, bz + (bz_cmd - bz) * k_m
    wx2, wy2, wz2 = wx + bx2 * dt, wy + by2 * dt, wz + bz2 * dt
    # half a step of q' = q x (0, omega) / 2 under the mean rates
    m = eighth * (wx + wx2), eighth * (wy + wy2), eighth * (wz + wz2)
    dw, dx, dy, dz = quaternion_rate((qw, qx, qy, qz), m)
    hw, hx, hy, hz = qw + dw, qx + dx, qy + dy, qz + dz
    # the thrust of the new step acts along the body's z axis in mid-step
    zx, zy, zz = thrust_axis(hw, hx, hy, hz)
    lift = k * a2
    ax, ay, az = zx * lift - drag * vx, zy * lift - drag * vy, zz * lift - drag * vz - GRAVITY
    vx2, vy2, vz2 = vx + ax * dt, vy + ay * dt, vz + az * dt
    qw2, qx2, qy2, qz2 = hw + dw, hx + dx, hy + dy, hz + dz
    # one Newton step on 1 / |q| renormalises
    n = 1.5 - 0.5 * (qw2 * qw2 + qx2 * qx2 + qy2 * qy2 + qz2 * qz2)
    px2, py2, pz2 = px + (vx + vx2) * half, py + (vy + vy2) * half, pz + (vz + vz2) * half
    return px2, py2, pz2, vx2, vy2, vz2, qw2 * n, qx2 * n, qy2 * n, qz2 * n, wx2, wy2, wz2, a2, bx2, by2, bz2


def attainable(x, u, p):
    """The command u with no more thrust than what its roll and pitch leave to the rotors.  (4,)

    For a vehicle whose flight controller does not see to that: where it clips the rotors' commands one by one, roll and
    pitch get half of what they ask for at full thrust. At most half of the thrust is given up.
    """
    k_x, k_y, _k_z, _k_m, _k, _drag, c_x, c_y, _per_c_z, a_max = p
    wx_cmd, wy_cmd, wz_cmd, a_cmd = u
    reserve = tilt_reserve(c_x, c_y, (wx_cmd - x[10]) * k_x, (wy_cmd - x[11]) * k_y)
    return wx_cmd, wy_cmd, wz_cmd, minimum(a_cmd, maximum(a_max - reserve, 0.5 * a_max))


Lag = Annotated[float, unit("s", ge=0, le=10)]
Rate = Annotated[float, unit("rad/s", gt=0, le=100)]
Factor = Annotated[float, Meta(gt=0, le=10)]
TiltCost = Annotated[float, unit("m", ge=0, le=10)]


@dataclass(frozen=True)
class ModelParams:
    """The numbers MPPI plans with. Plant and model may differ; a run stores both."""

    rate_tau: tuple[Lag, Lag, Lag]  # lag of the body rates about x, y, z [s]
    motor_tau: Lag  # lag of the rotors, for thrust and torque [s]; 0: they follow at once
    drag: Annotated[float, unit("1/s", ge=0, le=20)]  # linear, isotropic [1/s]
    rate_max: tuple[Rate, Rate, Rate]  # limit of the body-rate commands [rad/s]
    thrust_max: Annotated[float, unit("m/s^2", gt=GRAVITY, le=1000)]  # mass-normalised limit [m/s^2]
    thrust_min: Annotated[float, unit("m/s^2", ge=0, lt=GRAVITY)] = 0.0  # mass-normalised limit [m/s^2]
    tilt_cost: tuple[TiltCost, TiltCost] = (0.0, 0.0)  # thrust given up per angular acceleration about x, y [m]
    yaw_cost: TiltCost = 0.0  # room to the thrust's limits per angular acceleration about z [m]; 0: none is needed
    thrust_gain: Factor = 1.0  # acceleration per thrust delivered: less than 1 where the vehicle is too heavy
    tilt_first: bool = True  # its flight controller gives up thrust to roll and pitch; False: the planner has to

    @classmethod
    def of(cls, vehicle: Vehicle) -> ModelParams:
        """The nominal model of a vehicle: its own numbers, with the mean of its drag."""
        rotors = vehicle.rotors
        return cls(
            rate_tau=vehicle.rate_tau,
            motor_tau=rotors.tau if rotors else 0.0,
            drag=sum(vehicle.drag) / 3,
            rate_max=vehicle.rate_max,
            thrust_max=vehicle.thrust_max,
            tilt_cost=tilt_cost(vehicle) if rotors else (0.0, 0.0),
            yaw_cost=vehicle.inertia[2] / (vehicle.mass * rotors.kappa) if rotors else 0.0,
        )


def tilt_cost(vehicle: Vehicle) -> tuple[float, float]:
    """Inertia over mass and lever arm: on every side of an axis two rotors carry half of the torque about it [m]."""
    assert vehicle.rotors
    x, y = (abs(arm) for arm in vehicle.rotors.positions[0])
    return vehicle.inertia[0] / (vehicle.mass * y), vehicle.inertia[1] / (vehicle.mass * x)


def quadrotor(model: ModelParams, dt: float) -> System:
    """The system MPPI plans with, at control period dt [s]."""
    gains = (*(response(tau, dt) / dt for tau in model.rate_tau), response(model.motor_tau, dt))
    per_c_z = 1.0 / model.yaw_cost if model.yaw_cost else UNLIMITED_YAW
    return System(
        name="quadrotor",
        states=STATE,
        controls=CONTROL,
        step=step,
        params=(*gains, model.thrust_gain, model.drag, *model.tilt_cost, per_c_z, model.thrust_max),
        dt=dt,
        low=(*(-r for r in model.rate_max), model.thrust_min),
        high=(*model.rate_max, model.thrust_max),
        rest=(0.0, 0.0, 0.0, GRAVITY),
        attainable=None if model.tilt_first else attainable,
    )
