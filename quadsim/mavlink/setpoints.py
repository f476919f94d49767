"""Convert a client's setpoints to the control of the vehicle.

Body rates and thrust are flown as they come. An attitude is reached by body rates in proportion to
the turn that is missing, a velocity by an acceleration in proportion to the velocity that is
missing, and a position by a velocity in proportion to the way that is left. The gains are ours:
those of the simulator of the AI Grand Prix are not published.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite
from typing import NamedTuple

import numpy as np

from quadsim.dynamics.quadrotor import Control, State
from quadsim.mavlink.axes import frd, ned, ned_attitude
from quadsim.mavlink.messages import SetAttitudeTarget, SetPositionTargetLocalNed
from quadsim.rotation import Quaternion, Vec3, between, euler_angles, from_euler, to_body
from quadsim.vehicle import GRAVITY, Vehicle

# Bits of SET_ATTITUDE_TARGET's type_mask: what is to be ignored
IGNORE_RATES = (1, 2, 4)
IGNORE_THRUST = 64
IGNORE_ATTITUDE = 128
# Bits of SET_POSITION_TARGET_LOCAL_NED's type_mask
IGNORE_POSITION = 0b111
IGNORE_VELOCITY = 0b111000
IGNORE_YAW = 1024
IGNORE_YAW_RATE = 2048
# MAV_FRAME_LOCAL_NED, the only frame of a position that is understood
LOCAL_NED = 1
# Body rate for each radian of the turn that is missing [1/s]
ATTITUDE_GAIN = 8.0
# Acceleration for each m/s that is missing [1/s], and its largest horizontal part [m/s^2]
VELOCITY_GAIN = 3.0
MOST_SIDEWAYS = 12.0
# Velocity for each metre that is left [1/s], and the largest [m/s]
POSITION_GAIN = 1.5
FASTEST = 10.0
# Body rate for each radian of yaw that is missing [1/s]
YAW_GAIN = 3.0


class Rates(NamedTuple):
    """Body rates, forward left up [rad/s], and thrust [m/s^2]."""

    body_rates: Vec3
    thrust: float


class AttitudeTarget(NamedTuple):
    """An attitude, forward left up in east north up, body rates beside it, and thrust [m/s^2]."""

    attitude: Quaternion
    # rate about each body axis that is flown in place of the attitude [rad/s]; None: the attitude
    body_rates: tuple[float | None, ...]
    thrust: float


class PathTarget(NamedTuple):
    """A position and a velocity of the world, east north up; a free one is None."""

    position: Vec3 | None  # [m]
    velocity: Vec3 | None  # [m/s]
    yaw: float | None  # [rad]
    yaw_rate: float  # [rad/s], without a yaw


Setpoint = Rates | AttitudeTarget | PathTarget


def attitude_setpoint(message: SetAttitudeTarget, vehicle: Vehicle) -> Setpoint | None:
    """Return what a client asks for by SET_ATTITUDE_TARGET; None: a number cannot be used.

    The thrust from 0 to 1 is a share of the vehicle's full thrust.
    """
    rates = (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate)
    if not _are_finite(*rates, message.thrust, *message.q):
        return None
    mask = message.type_mask
    share = 0.0 if mask & IGNORE_THRUST else min(max(message.thrust, 0.0), 1.0)
    thrust = share * vehicle.thrust_max
    used = [0.0 if mask & bit else rate for bit, rate in zip(IGNORE_RATES, rates, strict=True)]
    if mask & IGNORE_ATTITUDE:
        return Rates(frd(used), thrust)
    length = hypot(*message.q)
    if length < 0.5:
        return None
    attitude = ned_attitude([c / length for c in message.q])
    # A rate that is not ignored is flown about its axis: MAVLink has them beside the attitude.
    given = frd(used)
    asked = tuple(
        None if mask & bit or not rate else rate
        for bit, rate in zip(IGNORE_RATES, given, strict=True)
    )
    return AttitudeTarget(attitude, asked, thrust)


def path_setpoint(message: SetPositionTargetLocalNed) -> PathTarget | None:
    """Return what a client asks for by SET_POSITION_TARGET_LOCAL_NED; None: it cannot be used."""
    place = (message.x, message.y, message.z)
    velocity = (message.vx, message.vy, message.vz)
    mask = message.type_mask
    has_place = mask & IGNORE_POSITION != IGNORE_POSITION
    has_velocity = mask & IGNORE_VELOCITY != IGNORE_VELOCITY
    used = (
        *(place if has_place else ()),
        *(velocity if has_velocity else ()),
        *(() if mask & IGNORE_YAW else (message.yaw,)),
        *(() if mask & IGNORE_YAW_RATE else (message.yaw_rate,)),
    )
    if message.coordinate_frame != LOCAL_NED or not _are_finite(*used):
        return None
    return PathTarget(
        position=ned(place) if has_place else None,
        velocity=ned(velocity) if has_velocity else None,
        # Yaw counts from north to the east there, from east to the north here.
        yaw=None if mask & IGNORE_YAW else 0.5 * np.pi - message.yaw,
        yaw_rate=0.0 if mask & IGNORE_YAW_RATE else -message.yaw_rate,
    )


def control_of(setpoint: Setpoint, x: State, vehicle: Vehicle) -> Control:
    """Return the control that a setpoint asks for, within the vehicle's limits.

    Args:
        setpoint: what the client asks for.
        x: the true state.
        vehicle: the vehicle.
    """
    if isinstance(setpoint, PathTarget):
        control = _along_path(setpoint, x)
    elif isinstance(setpoint, AttitudeTarget):
        control = _towards(setpoint.attitude, setpoint.body_rates, setpoint.thrust, x)
    else:
        control = Control(*setpoint.body_rates, setpoint.thrust)
    rates = (control.wx, control.wy, control.wz)
    wx, wy, wz = (
        min(max(rate, -most), most) for rate, most in zip(rates, vehicle.omega_max, strict=True)
    )
    return Control(wx, wy, wz, min(max(control.thrust, 0.0), vehicle.thrust_max))


def _towards(
    attitude: Quaternion, body_rates: Sequence[float | None], thrust: float, x: State
) -> Control:
    """Return the control that turns to an attitude, with some body rates given [rad/s]."""
    turn = between(x.attitude, attitude)
    wx, wy, wz = (
        ATTITUDE_GAIN * angle if rate is None else rate
        for angle, rate in zip(turn, body_rates, strict=True)
    )
    return Control(wx, wy, wz, thrust)


def _along_path(target: PathTarget, x: State) -> Control:
    """Return the control that flies to a position, or at a velocity."""
    wanted = np.zeros(3) if target.velocity is None else np.array(target.velocity)
    if target.position is not None:
        away = np.array(target.position) - np.array(x.position)
        wanted = wanted + _shortened(POSITION_GAIN * away, FASTEST)
    missing = VELOCITY_GAIN * (wanted - np.array(x.velocity))
    sideways = _shortened(missing[:2], MOST_SIDEWAYS)
    force = np.array([*sideways, max(missing[2] + GRAVITY, 0.3 * GRAVITY)])

    # The body's z axis along the force; the yaw is turned to by itself.
    yaw, _, _ = euler_angles(x.attitude)
    ahead = to_body(from_euler(yaw, 0.0, 0.0), force)
    pitch = np.arctan2(ahead[0], ahead[2])
    roll = np.arctan2(-ahead[1], hypot(ahead[0], ahead[2]))
    attitude = from_euler(yaw, float(pitch), float(roll))
    yaw_rate = target.yaw_rate
    if target.yaw is not None:
        missing_yaw = (target.yaw - yaw + np.pi) % (2.0 * np.pi) - np.pi
        yaw_rate = YAW_GAIN * missing_yaw
    along = to_body(x.attitude, force)[2]
    control = _towards(attitude, (None, None, None), along, x)
    turning = to_body(x.attitude, (0.0, 0.0, yaw_rate))
    wx, wy, wz = (a + b for a, b in zip(control[:3], turning, strict=True))
    return Control(wx, wy, wz, along)


def _shortened(v: np.ndarray, most: float) -> np.ndarray:
    """Return a vector, no longer than `most`."""
    length = float(np.linalg.norm(v))
    return v if length <= most else v * (most / length)


def _are_finite(*numbers: float) -> bool:
    """Return whether all numbers are finite."""
    return all(map(isfinite, numbers))
