"""The quadrotor that MPPI plans with: first-order body rates behind rotors that lag, linear drag.

    p' = v
    v' = k R(q) e_z a - g e_z - d v
    q' = q x (0, omega) / 2
    omega' = beta
    beta' = (beta_cmd - beta) / tau_beta,               beta_cmd = (omega_cmd - omega) / tau_omega
    a' = (a_lim - a) / tau_m,                           a_lim = clip(a_cmd, r, a_max - r)
    r = c_x |beta_cmd,x| + c_y |beta_cmd,y| (+ c_z |beta_cmd,z|)
    |beta_cmd,z| <= (min(a_lim, a_max - a_lim) - r) / c_z

The state has the 13 numbers of Vlahov et al. 2024, section IV-B, and four more for what the rotors
deliver now: thrust a and angular acceleration beta. To roll or pitch, two rotors give up the thrust
r that the others, at their limit, cannot add. Yaw has what is left then: two rotors speed up, two
slow down, and at full thrust none can. The plant's allocation has the same order
(quadsim.dynamics.allocation). With tau_m = tau_beta = c = 0, the paper's model, thrust and angular
acceleration follow their commands at once.

tau_beta is the lag of the rotors, tau_m, behind an ideal rate loop. A real one has filters and
gains of its own; omega then follows its command as a second-order system, of natural frequency
1 / sqrt(tau_omega tau_beta) and damping ratio sqrt(tau_omega / tau_beta) / 2. c_z in r is for a
mixer that gives up thrust to yaw, too; the limit of yaw falls away then.

What is learned in flight of rotors of unequal strength acts between limits and lag: the rotors
deliver E (a_lim, beta_lim) + b in place of (a_lim, beta_lim) (`learned_step`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Annotated, Any, NamedTuple

from msgspec import Meta
from numpy import maximum, minimum

from quadsim.dynamics import System
from quadsim.dynamics.first_order import response, response_over
from quadsim.dynamics.named_tuples import units_of
from quadsim.files.strict_yaml import setting, unit
from quadsim.rotation import Quaternion, Vec3, quaternion_rate
from quadsim.vehicle import GRAVITY, Vehicle


class State(NamedTuple):
    """The state of the quadrotor.

    Position and velocity are in the world frame (ENU); body rates, thrust and angular acceleration
    are in the body frame. Every table of the project has the order of these names: telemetry, the
    compiled lanes, the optimiser.

    Examples:
        >>> import numpy as np
        >>> from quadsim.dynamics.quadrotor import State
        >>> x = np.zeros(17)  # as a controller is given it
        >>> x[2], x[6] = 2.0, 1.0
        >>> state = State(*x)
        >>> state.pz.item(), len(state.attitude)
        (2.0, 4)
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
    # mass-normalised thrust that the rotors deliver now
    thrust: Annotated[float, "m/s^2"]
    # angular acceleration that the rotors deliver now
    bx: Annotated[float, "rad/s^2"]
    by: Annotated[float, "rad/s^2"]
    bz: Annotated[float, "rad/s^2"]

    @property
    def position(self) -> Vec3:
        """The position in the world [m]."""
        return self.px, self.py, self.pz

    @property
    def velocity(self) -> Vec3:
        """The velocity in the world [m/s]."""
        return self.vx, self.vy, self.vz

    @property
    def attitude(self) -> Quaternion:
        """The attitude, a unit quaternion wxyz, world from body."""
        return self.qw, self.qx, self.qy, self.qz

    @property
    def body_rates(self) -> Vec3:
        """The body rates, about the body's axes [rad/s]."""
        return self.wx, self.wy, self.wz

    @property
    def angular_acceleration(self) -> Vec3:
        """The angular acceleration that the rotors deliver, about the body's axes [rad/s^2]."""
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
        """Return the state with these vectors, named as the properties above.

        A number that is added to the state takes its default, so that plants and estimators do not
        have to know of it.
        """
        numbers = (*position, *velocity, *attitude, *body_rates, thrust, *angular_acceleration)
        return cls(*numbers)  # pyright: ignore[reportCallIssue]


class Control(NamedTuple):
    """A command to the flight controller: body rates and mass-normalised thrust."""

    wx: Annotated[float, "rad/s"]
    wy: Annotated[float, "rad/s"]
    wz: Annotated[float, "rad/s"]
    thrust: Annotated[float, "m/s^2"]

    @property
    def body_rates(self) -> Vec3:
        """The commanded body rates, about the body's axes [rad/s]."""
        return self.wx, self.wy, self.wz


class Params(NamedTuple):
    """The numbers of `step`, made of ModelParams for one step length by `quadrotor`."""

    # angular acceleration asked for per error of the body rate [1/s]
    rate_gain_x: float
    rate_gain_y: float
    rate_gain_z: float
    # share of the way to its command that the thrust makes in one step
    rotor_response: float
    # the same of the angular acceleration
    rate_response_x: float
    rate_response_y: float
    rate_response_z: float
    # k, acceleration per thrust delivered
    thrust_gain: float
    # d [1/s]
    drag: float
    # c_x and c_y, thrust given up per angular acceleration about x and y [m]
    tilt_cost_x: float
    tilt_cost_y: float
    # 1 / c_z, angular acceleration about z per room to the thrust's limits [1/m]
    yaw_per_room: float
    # thrust given up per angular acceleration about z [m]
    yaw_reserve: float
    # mass-normalised [m/s^2]
    thrust_max: float
    # the numbers of Delivered, which only `learned_step` uses
    thrust_share: float = 1.0
    turn_x: float = 0.0
    turn_y: float = 0.0
    turn_z: float = 0.0
    always_x: float = 0.0
    always_y: float = 0.0
    always_z: float = 0.0

    @property
    def rate_gains(self) -> Vec3:
        """The gains of the rate loop, about the body's axes [1/s]."""
        return self.rate_gain_x, self.rate_gain_y, self.rate_gain_z

    def over(self, periods: int, dt: float) -> Params:
        """Return the numbers for a step of several control periods under one command.

        Lags are exact. The gains of the rate loop are those with which body rates that are steady
        at first change by as much as in single periods.

        Args:
            periods: number of control periods.
            dt: control period [s].
        """
        if periods == 1:
            return self
        lags = (self.rate_response_x, self.rate_response_y, self.rate_response_z)
        longer = [response_over(lag, periods) for lag in lags]
        gains = [
            rate_change(gain, lag, periods, dt) / (periods * dt * response)
            for gain, lag, response in zip(self.rate_gains, lags, longer, strict=True)
        ]
        rate_gain_x, rate_gain_y, rate_gain_z = gains
        rate_response_x, rate_response_y, rate_response_z = longer
        return self._replace(
            rate_gain_x=rate_gain_x,
            rate_gain_y=rate_gain_y,
            rate_gain_z=rate_gain_z,
            rotor_response=response_over(self.rotor_response, periods),
            rate_response_x=rate_response_x,
            rate_response_y=rate_response_y,
            rate_response_z=rate_response_z,
        )


def rate_change(gain: float, lag: float, periods: int, dt: float) -> float:
    """Return the step response of a body rate after some control periods.

    Args:
        gain: gain of the rate loop [1/s].
        lag: share of an error of the angular acceleration that disappears in one period.
        periods: number of control periods.
        dt: control period [s].

    Returns:
        The change of the body rate, as a share of the commanded change.
    """
    rate, acceleration = 0.0, 0.0
    for _ in range(periods):
        acceleration += ((1.0 - rate) * gain - acceleration) * lag
        rate += acceleration * dt
    return rate


# Columns of telemetry: the names above, but for the thrust, which is written `a` there.
STATE_UNITS = {("a" if name == "thrust" else name): unit for name, unit in units_of(State).items()}
CONTROL_UNITS = {
    ("a_cmd" if name == "thrust" else f"{name}_cmd"): unit
    for name, unit in units_of(Control).items()
}
STATE = tuple(STATE_UNITS)
CONTROL = tuple(CONTROL_UNITS)


def columns(first: str, last: str) -> slice:
    """Return the columns from one field of State to another, both included.

    It is for tables of states, e.g. x[:, POSITION].
    """
    return slice(State._fields.index(first), State._fields.index(last) + 1)


# For tables of states and for the optimiser's vectors; a single State has properties of these
# names.
POSITION = columns("px", "pz")
VELOCITY = columns("vx", "vz")
ATTITUDE = columns("qw", "qz")
BODY_RATES = columns("wx", "wz")
# position, velocity and attitude, which a picture of the vehicle shows
POSE = columns("px", "qz")
# all but what the rotors deliver
RIGID_BODY = columns("px", "wz")

# [m/s^2] A little room is always left for yaw, so that UNLIMITED_YAW has no limit at full thrust.
LEAST_ROOM = 1e-3
# [1/m] 1 / c_z of a vehicle without rotors.
UNLIMITED_YAW = 1e9
# [rad/s^2] Angular acceleration about z that a weak rotor may cause at full thrust
SPIN = 2.0
# Share of full thrust below which the thrust of rotors at idle does not matter
NEGLIGIBLE_IDLE = 0.01


def thrust_axis(qw, qx, qy, qz):
    """Return R(q) e_z, the body's z axis, along which the thrust acts, in the world.  (3,)"""
    return 2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx), 1.0 - 2.0 * (qx * qx + qy * qy)


def rate_loop(body_rates, commanded, gains):
    """Return the angular acceleration that the rate loop asks for, beta_cmd [rad/s^2].

    Args:
        body_rates: omega, about the body's axes [rad/s]  (3,).
        commanded: omega_cmd [rad/s]  (3,).
        gains: about each axis [1/s]  (3,).

    Returns:
        (3,)
    """
    wx, wy, wz = body_rates
    wx_cmd, wy_cmd, wz_cmd = commanded
    gain_x, gain_y, gain_z = gains
    return (wx_cmd - wx) * gain_x, (wy_cmd - wy) * gain_y, (wz_cmd - wz) * gain_z


def tilt_reserve(c_x, c_y, bx, by):
    """Return r = c_x |beta_x| + c_y |beta_y|, the thrust kept free for roll and pitch [m/s^2].

    Args:
        c_x, c_y: thrust given up per angular acceleration about x and y [m].
        bx, by: angular acceleration that is asked for about x and y [rad/s^2].
    """
    return c_x * abs(bx) + c_y * abs(by)


class Drive(NamedTuple):
    """A thrust and an angular acceleration: a demand on the rotors, or the rotors' output."""

    # mass-normalised [m/s^2]
    thrust: float
    # angular acceleration [rad/s^2]
    bx: float
    by: float
    bz: float


def step(x, u, p, dt):
    """Return the state after dt [s] under a constant command.

    A plain function of named scalars: it is flown on floats, checked on arrays, inlined into the
    compiled rollouts and differentiated by the optimiser.

    Args:
        x: State.
        u: Control.
        p: Params.
        dt: [s]

    Returns:
        State.
    """
    return driven(x, asked(x, u, p), p, dt)


def learned_step(x, u, p, dt):
    """Return the state after dt [s] with the output of the rotors that was estimated in flight.

    Args and the state that is returned are those of `step`.
    """
    return driven(x, deliver(asked(x, u, p), p), p, dt)


def asked(x, u, p):
    """Return the demand of the flight controller on the rotors within their limits, a Drive."""
    # The limits of the rotors leave roll and pitch all of what the rate loop asks for, the thrust
    # what these leave, and yaw what is left then.
    bx_cmd, by_cmd, bz_cmd = rate_loop(x.body_rates, u.body_rates, p.rate_gains)
    reserve = tilt_reserve(p.tilt_cost_x, p.tilt_cost_y, bx_cmd, by_cmd)
    reserve = reserve + p.yaw_reserve * abs(bz_cmd)
    most = p.thrust_max - reserve
    thrust_lim = minimum(maximum(u.thrust, reserve), most)
    room = maximum(minimum(thrust_lim - reserve, most - thrust_lim), 0.0) + LEAST_ROOM
    bz_max = room * p.yaw_per_room
    bz_cmd = minimum(maximum(bz_cmd, -bz_max), bz_max)
    return Drive(thrust_lim, bx_cmd, by_cmd, bz_cmd)


def deliver(drive, p):
    """Return the output of unequal rotors, with the torques that the rate loop does not know.

    Args:
        drive: demand on the rotors, a Drive.
        p: Params or Delivered.

    Returns:
        Drive.

    A weak rotor turns the vehicle in proportion to the thrust. That it also couples the axes with
    one another is left out: the rate loop corrects it.
    """
    return Drive(
        thrust=p.thrust_share * drive.thrust,
        bx=drive.bx + p.turn_x * drive.thrust + p.always_x,
        by=drive.by + p.turn_y * drive.thrust + p.always_y,
        bz=drive.bz + p.turn_z * drive.thrust + p.always_z,
    )


def driven(x, drive, p, dt):
    """Return the state after dt [s] in which the rotors follow a Drive with a first-order lag."""
    thrust = x.thrust + (drive.thrust - x.thrust) * p.rotor_response
    bx = x.bx + (drive.bx - x.bx) * p.rate_response_x
    by = x.by + (drive.by - x.by) * p.rate_response_y
    bz = x.bz + (drive.bz - x.bz) * p.rate_response_z
    wx = x.wx + bx * dt
    wy = x.wy + by * dt
    wz = x.wz + bz * dt

    # Half a step of q' = q x (0, omega) / 2 under the mean rates.
    eighth = 0.125 * dt
    turn = eighth * (x.wx + wx), eighth * (x.wy + wy), eighth * (x.wz + wz)
    dw, dx, dy, dz = quaternion_rate(x.attitude, turn)
    half_qw = x.qw + dw
    half_qx = x.qx + dx
    half_qy = x.qy + dy
    half_qz = x.qz + dz

    # The thrust of the new step acts along the body's z axis in mid-step.
    zx, zy, zz = thrust_axis(half_qw, half_qx, half_qy, half_qz)
    lift = p.thrust_gain * thrust
    ax = zx * lift - p.drag * x.vx
    ay = zy * lift - p.drag * x.vy
    az = zz * lift - p.drag * x.vz - GRAVITY
    vx = x.vx + ax * dt
    vy = x.vy + ay * dt
    vz = x.vz + az * dt

    # The other half of the turn; one Newton step on 1 / |q| renormalises.
    qw = half_qw + dw
    qx = half_qx + dx
    qy = half_qy + dy
    qz = half_qz + dz
    scale = 1.5 - 0.5 * (qw * qw + qx * qx + qy * qy + qz * qz)

    half = 0.5 * dt
    return State(
        px=x.px + (x.vx + vx) * half,
        py=x.py + (x.vy + vy) * half,
        pz=x.pz + (x.vz + vz) * half,
        vx=vx,
        vy=vy,
        vz=vz,
        qw=qw * scale,
        qx=qx * scale,
        qy=qy * scale,
        qz=qz * scale,
        wx=wx,
        wy=wy,
        wz=wz,
        thrust=thrust,
        bx=bx,
        by=by,
        bz=bz,
    )


def attainable(x, u, p):
    """Return the command u with no more thrust than its roll and pitch leave to the rotors.

    It is for a vehicle whose flight controller does not see to that: where the rotors' commands are
    clipped one by one, roll and pitch get half of what they ask for at full thrust. At most half of
    the thrust is given up.

    Args:
        x: State.
        u: Control.
        p: Params.

    Returns:
        Control.
    """
    bx_cmd, by_cmd, _ = rate_loop(x.body_rates, u.body_rates, p.rate_gains)
    reserve = tilt_reserve(p.tilt_cost_x, p.tilt_cost_y, bx_cmd, by_cmd)
    thrust = minimum(u.thrust, maximum(p.thrust_max - reserve, 0.5 * p.thrust_max))
    return Control(u.wx, u.wy, u.wz, thrust)


Lag = Annotated[float, unit("s", ge=0, le=10)]
Delay = Annotated[float, unit("s", ge=0, le=1)]
Rate = Annotated[float, unit("rad/s", gt=0, le=100)]
Factor = Annotated[float, Meta(gt=0, le=10)]
TiltCost = Annotated[float, unit("m", ge=0, le=10)]


@dataclass(frozen=True)
class ModelParams:
    """The numbers of the model that MPPI plans with.

    The plant may differ from it; a run stores both.
    """

    rate_tau: Annotated[tuple[Lag, Lag, Lag], setting("lag of the body rates about x, y, z")]
    motor_tau: Annotated[
        Lag, setting("lag of the rotors, for thrust and torque; 0: they follow at once")
    ]
    drag: Annotated[float, setting("linear, isotropic drag", unit="1/s", ge=0, le=20)]
    rate_max: Annotated[tuple[Rate, Rate, Rate], setting("limit of the body-rate commands")]
    thrust_max: Annotated[
        float,
        setting("largest mass-normalised thrust", unit="m/s^2", gt=GRAVITY, le=1000),
    ]
    thrust_min: Annotated[
        float,
        setting("least mass-normalised thrust", unit="m/s^2", ge=0, lt=GRAVITY),
    ] = 0.0
    tilt_cost: Annotated[
        tuple[TiltCost, TiltCost],
        setting("thrust given up per angular acceleration about x, y"),
    ] = (0.0, 0.0)
    yaw_cost: Annotated[
        TiltCost,
        setting("room to the thrust's limits per angular acceleration about z; 0: none is needed"),
    ] = 0.0
    thrust_gain: Annotated[
        Factor,
        setting("acceleration per thrust delivered: less than 1 where the vehicle is too heavy"),
    ] = 1.0
    tilt_first: Annotated[
        bool,
        setting(
            "whether the flight controller gives up thrust to roll and pitch; False: the planner "
            "has to"
        ),
    ] = True
    yaw_first: Annotated[
        bool,
        setting("whether the flight controller gives up thrust to yaw, as to roll and pitch"),
    ] = False
    rate_lag: Annotated[
        tuple[Lag, Lag, Lag] | None,
        setting("lag of the angular acceleration about x, y, z (default: the rotors')"),
    ] = None
    delay: Annotated[
        Delay,
        setting("time from a command to its effect, beside the latency of vehicle and link"),
    ] = 0.0

    @property
    def rate_lags(self) -> Vec3:
        """The lags of the angular acceleration, about the body's axes [s]."""
        lag = self.motor_tau
        return self.rate_lag or (lag, lag, lag)

    @classmethod
    def of(cls, vehicle: Vehicle) -> ModelParams:
        """Return the nominal model of a vehicle: its own numbers, with the mean of its drag."""
        rotors = vehicle.rotors
        motor_tau = rotors.motor_tau if rotors else 0.0
        tau, lag = led_rate_loop(vehicle, motor_tau)
        return cls(
            rate_tau=tau,
            motor_tau=motor_tau,
            drag=sum(vehicle.drag) / 3,
            rate_max=vehicle.omega_max,
            thrust_max=vehicle.thrust_max,
            thrust_min=thrust_min(vehicle),
            tilt_cost=tilt_cost(vehicle) if rotors else (0.0, 0.0),
            yaw_cost=vehicle.inertia[2] / (vehicle.mass * rotors.kappa) if rotors else 0.0,
            rate_lag=lag,
        )


class Delivered(NamedTuple):
    """Differences between the demand on the rotors and their output, estimated in flight."""

    # share of the demanded thrust that the rotors produce, 1 for sound rotors
    thrust_share: float = 1.0
    # angular acceleration per thrust without a demand for it [1/m]
    turn_x: float = 0.0
    turn_y: float = 0.0
    turn_z: float = 0.0
    # angular acceleration that is always there [rad/s^2]
    always_x: float = 0.0
    always_y: float = 0.0
    always_z: float = 0.0

    @property
    def turn(self) -> Vec3:
        """The angular acceleration per thrust without a demand for it [1/m]."""
        return self.turn_x, self.turn_y, self.turn_z

    @property
    def always(self) -> Vec3:
        """The angular acceleration that is always there [rad/s^2]."""
        return self.always_x, self.always_y, self.always_z


@dataclass(frozen=True)
class LearnedModel(ModelParams):
    """A model with the output of the rotors that was estimated in flight."""

    delivered: Delivered = Delivered()  # noqa: RUF009 (immutable)

    @classmethod
    def of_model(cls, model: ModelParams, delivered: Delivered) -> LearnedModel:
        """Return a model with this output of the rotors."""
        numbers: dict[str, Any] = vars(model)
        return cls(**{**numbers, "delivered": delivered})


def led_rate_loop(vehicle: Vehicle, motor_tau: float) -> tuple[Vec3, Vec3 | None]:
    """Return tau_omega and tau_beta of a rate loop with a derivative of its own [s].

    The loop asks for beta_cmd = (omega_cmd - omega - lead beta) / tau and the rotors follow by
    motor_tau beta' = beta_cmd - beta. Together that is the model above, with tau_omega = tau + lead
    and tau_beta = motor_tau tau / (tau + lead): a lead damps the loop and lets it be faster.

    Args:
        vehicle: vehicle with the rate loop.
        motor_tau: lag of its rotors [s].

    Returns:
        tau_omega, and tau_beta, which is None without a lead: the rotors' lag.
    """
    if not any(vehicle.rate_lead):
        return vehicle.rate_tau, None
    pairs = list(zip(vehicle.rate_tau, vehicle.rate_lead, strict=True))
    tau_x, tau_y, tau_z = (tau + lead for tau, lead in pairs)
    lag_x, lag_y, lag_z = (motor_tau * tau / (tau + lead) for tau, lead in pairs)
    return (tau_x, tau_y, tau_z), (lag_x, lag_y, lag_z)


def thrust_min(vehicle: Vehicle) -> float:
    """Return the least mass-normalised thrust that is planned with [m/s^2].

    Rotors at idle cannot be slowed down for a roll or a pitch, which then raises the thrust. Above
    twice the thrust at idle the slower rotors can give up as much as the idle leaves. Zero where
    the idle does not matter.
    """
    rotors = vehicle.rotors
    if rotors is None:
        return 0.0
    idle = 4 * max(rotors.thrust(rotors.motor_omega_min), 0.0) / vehicle.mass
    return 2 * idle if idle > NEGLIGIBLE_IDLE * vehicle.thrust_max else 0.0


def tilt_cost(vehicle: Vehicle) -> tuple[float, float]:
    """Return c_x and c_y, inertia over mass and lever arm [m].

    On either side of an axis two rotors carry half of the torque about it. A rate loop with a lead
    asks for (tau + lead) / tau times the torque of the model's at first, and for less than that as
    the rotors follow: for the square root of it on average.
    """
    assert vehicle.rotors
    x, y = (abs(arm) for arm in vehicle.rotors.positions[0])
    more_x, more_y = (
        sqrt((tau + lead) / tau) if lead else 1.0
        for tau, lead in zip(vehicle.rate_tau[:2], vehicle.rate_lead[:2], strict=True)
    )
    c_x = vehicle.inertia[0] / (vehicle.mass * y)
    c_y = vehicle.inertia[1] / (vehicle.mass * x)
    return c_x * more_x, c_y * more_y


def quadrotor(model: ModelParams, dt: float) -> System:
    """Return the system that MPPI plans with.

    Args:
        model: its numbers.
        dt: control period [s].
    """
    gain_x, gain_y, gain_z = (response(tau, dt) / dt for tau in model.rate_tau)
    response_x, response_y, response_z = (response(lag, dt) for lag in model.rate_lags)
    tilt_cost_x, tilt_cost_y = model.tilt_cost
    is_free = model.yaw_first or not model.yaw_cost
    params = Params(
        rate_gain_x=gain_x,
        rate_gain_y=gain_y,
        rate_gain_z=gain_z,
        rotor_response=response(model.motor_tau, dt),
        rate_response_x=response_x,
        rate_response_y=response_y,
        rate_response_z=response_z,
        thrust_gain=model.thrust_gain,
        drag=model.drag,
        tilt_cost_x=tilt_cost_x,
        tilt_cost_y=tilt_cost_y,
        yaw_per_room=UNLIMITED_YAW if is_free else 1.0 / model.yaw_cost,
        yaw_reserve=model.yaw_cost if model.yaw_first else 0.0,
        thrust_max=model.thrust_max,
    )
    # A vehicle that has lost rotors may not be able to hover.
    hover = min(max(GRAVITY, model.thrust_min), model.thrust_max)
    rest = Control(0.0, 0.0, 0.0, hover)
    most = model.thrust_max
    if isinstance(model, LearnedModel):
        params = params._replace(**model.delivered._asdict())
        rest = trimmed(rest, params, model.rate_max)
        most = max(hover, steady_thrust(model))
    return System(
        name="quadrotor",
        state=State,
        control=Control,
        step=learned_step if isinstance(model, LearnedModel) else step,
        params=params,
        dt=dt,
        low=Control._make((*(-rate for rate in model.rate_max), model.thrust_min)),
        high=Control(*model.rate_max, thrust=most),
        rest=rest,
        attainable=None if model.tilt_first else attainable,
        adapted=adapted if isinstance(model, LearnedModel) else None,
    )


def adapted(u, before, now):
    """Return the command that has the effect under new estimates that u had under earlier ones.

    Thrust and body rates are changed so that the rotors deliver the same thrust and angular
    acceleration. The thrust is not raised above its present limit.

    Args:
        u: Control.
        before: System with the earlier estimates.
        now: System with the present ones.

    Returns:
        Control.
    """
    p = now.params
    thrust = u.thrust * (before.params.thrust_share / p.thrust_share)
    thrust = minimum(thrust, maximum(now.high.thrust, u.thrust))
    was = deliver(Drive(u.thrust, 0.0, 0.0, 0.0), before.params)
    is_now = deliver(Drive(thrust, 0.0, 0.0, 0.0), p)
    return Control(
        u.wx + (was.bx - is_now.bx) / p.rate_gain_x,
        u.wy + (was.by - is_now.by) / p.rate_gain_y,
        u.wz + (was.bz - is_now.bz) / p.rate_gain_z,
        thrust,
    )


def steady_thrust(model: LearnedModel) -> float:
    """Return the highest thrust at which the vehicle can be kept from turning [m/s^2].

    At full thrust the mixer gives up yaw, so a weak rotor makes the vehicle spin. An angular
    acceleration about z of SPIN is allowed: it ends when the thrust falls.
    """
    costs = (*model.tilt_cost, model.yaw_cost)
    if model.yaw_first or not model.yaw_cost:
        return model.thrust_max
    known = model.delivered
    of_thrust = sum(c * abs(turn) for c, turn in zip(costs, known.turn, strict=True))
    always = sum(c * abs(torque) for c, torque in zip(costs, known.always, strict=True))
    steady = (model.thrust_max - always + SPIN * model.yaw_cost) / (1.0 + of_thrust)
    return min(steady, model.thrust_max)


def trimmed(rest: Control, p: Params, rate_max: Vec3) -> Control:
    """Return the control whose body rates hold a learned vehicle still.

    Args:
        rest: the control that holds a sound vehicle still.
        p: numbers of the learned vehicle.
        rate_max: limits of the body rates, of which at most half is used [rad/s].
    """
    unasked = deliver(Drive(rest.thrust, 0.0, 0.0, 0.0), p)
    wx, wy, wz = (
        min(max(0.0 - beta / gain, -most / 2), most / 2)
        for beta, gain, most in zip(unasked[1:], p.rate_gains, rate_max, strict=True)
    )
    return Control(wx, wy, wz, rest.thrust)
