"""Convert a client's setpoints to the control of the vehicle.

Body rates and thrust are flown as they come. An attitude is reached by body rates in proportion to
the turn that is missing, a velocity by an acceleration in proportion to the velocity that is
missing, and a position by a velocity in proportion to the way that is left. The gains are ours:
those of the simulator of the AI Grand Prix are not published.

A setpoint is read as PX4 reads it, axis by axis: a number counts unless its bit of `type_mask` is
set or it is NaN. What PX4 would use in part, or not at all, is refused as a whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, isfinite, isinf, isnan, nan
from typing import NamedTuple

import numpy as np

from quadsim.dynamics.quadrotor import Control, State
from quadsim.mavlink.axes import frd, ned, ned_attitude
from quadsim.mavlink.messages import SetAttitudeTarget, SetPositionTargetLocalNed
from quadsim.rotation import Quaternion, Vec3, between, euler_angles, from_euler, to_body, to_world
from quadsim.vehicle import GRAVITY, Vehicle

# Bits of SET_ATTITUDE_TARGET's type_mask
IGNORE_RATES = (1, 2, 4)
THRUST_BODY = 32  # the thrust is a vector, `thrust_body`
IGNORE_THRUST = 64
IGNORE_ATTITUDE = 128
# Bits of SET_POSITION_TARGET_LOCAL_NED's type_mask: what is to be ignored, for each axis
IGNORE_POSITION = (1, 2, 4)
IGNORE_VELOCITY = (8, 16, 32)
IGNORE_ACCELERATION = (64, 128, 256)
FORCE = 512  # the acceleration is a force
IGNORE_YAW = 1024
IGNORE_YAW_RATE = 2048
# MAV_FRAME_LOCAL_NED and MAV_FRAME_BODY_NED, the frames that PX4 takes
LOCAL_NED = 1
BODY_NED = 8
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
# A free axis, and a vector whose axes are all free
FREE = nan
ALL_FREE: Vec3 = (nan, nan, nan)


class SetpointError(ValueError):
    """A setpoint that cannot be flown; the message says why, in at most 50 characters."""


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
    """A position, a velocity and an acceleration of the world, east north up; NaN: a free axis."""

    position: Vec3  # [m]
    velocity: Vec3  # [m/s]
    acceleration: Vec3  # [m/s^2], without gravity
    yaw: float | None  # [rad]
    yaw_rate: float  # [rad/s]


class BodyTarget(NamedTuple):
    """A velocity and an acceleration in axes of the vehicle, forward left up; NaN: free."""

    velocity: Vec3  # [m/s], about the vehicle's heading alone
    acceleration: Vec3  # [m/s^2], without gravity, in the axes of the tilted body
    yaw: float | None  # [rad], of the world
    yaw_rate: float  # [rad/s]


Setpoint = Rates | AttitudeTarget | PathTarget | BodyTarget


@dataclass
class Law:
    """The law by which a setpoint is flown: the control at each state.

    Attributes:
        setpoint: what the client asks for.
        vehicle: the vehicle.
    """

    setpoint: Setpoint
    vehicle: Vehicle

    def __call__(self, x: State) -> Control:
        """Return the control at a true state."""
        # As in PX4, axes of the vehicle are those at the time when the setpoint comes.
        if isinstance(self.setpoint, BodyTarget):
            self.setpoint = in_world(self.setpoint, x)
        return control_of(self.setpoint, x, self.vehicle)


def attitude_setpoint(message: SetAttitudeTarget, vehicle: Vehicle) -> Rates | AttitudeTarget:
    """Return what a client asks for by SET_ATTITUDE_TARGET.

    The thrust from 0 to 1 is a share of the vehicle's full thrust. Like PX4, it needs an attitude,
    or body rates of roll and pitch.

    Raises:
        SetpointError: it cannot be flown.
    """
    mask = message.type_mask
    rates = _used(
        (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate), mask, IGNORE_RATES
    )
    _expect_no_infinity(*rates)
    if mask & THRUST_BODY:
        raise SetpointError("setpoint refused: bit 32, expected thrust")
    if mask & IGNORE_THRUST or not isfinite(message.thrust):
        raise SetpointError("setpoint refused: expected a thrust from 0 to 1")
    thrust = min(max(message.thrust, 0.0), 1.0) * vehicle.thrust_max

    if mask & IGNORE_ATTITUDE:
        if isnan(rates[0]) or isnan(rates[1]):
            raise SetpointError("setpoint refused: expected roll and pitch rates")
        return Rates(frd([0.0 if isnan(rate) else rate for rate in rates]), thrust)

    length = hypot(*message.q)
    if not isfinite(length) or length < 0.5:
        raise SetpointError("setpoint refused: expected a unit quaternion")
    attitude = ned_attitude([c / length for c in message.q])
    # A rate that is not ignored is flown about its axis: MAVLink has them beside the attitude.
    asked = tuple(None if isnan(rate) or not rate else rate for rate in frd(rates))
    return AttitudeTarget(attitude, asked, thrust)


def path_setpoint(message: SetPositionTargetLocalNed) -> PathTarget | BodyTarget:
    """Return what a client asks for by SET_POSITION_TARGET_LOCAL_NED.

    Like PX4, each axis needs a position, a velocity or an acceleration, and north and east need the
    same of them. In axes of the vehicle, a position has no meaning, and velocity and acceleration
    are of all axes or of none.

    Raises:
        SetpointError: it cannot be flown.
    """
    mask = message.type_mask
    place = _used((message.x, message.y, message.z), mask, IGNORE_POSITION)
    velocity = _used((message.vx, message.vy, message.vz), mask, IGNORE_VELOCITY)
    acceleration = _used((message.afx, message.afy, message.afz), mask, IGNORE_ACCELERATION)
    (yaw,) = _used((message.yaw,), mask, (IGNORE_YAW,))
    (yaw_rate,) = _used((message.yaw_rate,), mask, (IGNORE_YAW_RATE,))
    _expect_no_infinity(*place, *velocity, *acceleration, yaw, yaw_rate)
    if mask & FORCE and not all(map(isnan, acceleration)):
        raise SetpointError("setpoint refused: force, expected acceleration")

    is_body = message.coordinate_frame == BODY_NED
    if is_body:
        _expect_body(place, velocity, acceleration)
    elif message.coordinate_frame != LOCAL_NED:
        frame = message.coordinate_frame
        raise SetpointError(f"setpoint refused: frame {frame}, expected 1 or 8")
    _expect_whole(place, velocity, acceleration)

    # Yaw counts from north to the east there, from east to the north here.
    turn = None if isnan(yaw) else 0.5 * np.pi - yaw
    turning = 0.0 if isnan(yaw_rate) else -yaw_rate
    if is_body:
        return BodyTarget(frd(velocity), frd(acceleration), turn, turning)
    return PathTarget(ned(place), ned(velocity), ned(acceleration), turn, turning)


def _used(numbers: Sequence[float], mask: int, bits: Sequence[int]) -> tuple[float, ...]:
    """Return numbers of a message, with NaN in place of numbers that the mask ignores."""
    return tuple(FREE if mask & bit else number for number, bit in zip(numbers, bits, strict=True))


def _expect_no_infinity(*numbers: float) -> None:
    """Raise SetpointError if a number is infinite."""
    if any(map(isinf, numbers)):
        raise SetpointError("setpoint refused: a number is infinite")


def _expect_body(
    place: Sequence[float], velocity: Sequence[float], acceleration: Sequence[float]
) -> None:
    """Raise SetpointError if PX4 would leave out a part of a setpoint in axes of the vehicle."""
    if not all(map(isnan, place)):
        raise SetpointError("setpoint refused: position in frame 8")
    for name, vector in (("velocity", velocity), ("acceleration", acceleration)):
        if any(map(isnan, vector)) and not all(map(isnan, vector)):
            raise SetpointError(f"setpoint refused: frame 8, part of {name}")


def _expect_whole(
    place: Sequence[float], velocity: Sequence[float], acceleration: Sequence[float]
) -> None:
    """Raise SetpointError if an axis has no setpoint, or north and east have different ones."""
    for axis, numbers in zip("xyz", zip(place, velocity, acceleration, strict=True), strict=True):
        if all(map(isnan, numbers)):
            raise SetpointError(f"setpoint refused: nothing for {axis}")
    for vector in (place, velocity, acceleration):
        if isnan(vector[0]) != isnan(vector[1]):
            raise SetpointError("setpoint refused: x and y differ in the mask")


def in_world(target: BodyTarget, x: State) -> PathTarget:
    """Return a target in axes of the vehicle as one in the axes of the world.

    Args:
        target: the target.
        x: the true state at the time of the target.
    """
    yaw, _, _ = euler_angles(x.attitude)
    velocity = to_world(from_euler(yaw, 0.0, 0.0), target.velocity)
    acceleration = to_world(x.attitude, target.acceleration)
    return PathTarget(ALL_FREE, velocity, acceleration, target.yaw, target.yaw_rate)


def control_of(setpoint: Setpoint, x: State, vehicle: Vehicle) -> Control:
    """Return the control that a setpoint asks for, within the vehicle's limits.

    Args:
        setpoint: what the client asks for.
        x: the true state.
        vehicle: the vehicle.
    """
    if isinstance(setpoint, BodyTarget):
        setpoint = in_world(setpoint, x)
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
    """Return the control that flies to a position, at a velocity, or with an acceleration."""
    place = np.array(target.position)
    velocity = np.array(target.velocity)
    is_followed = np.isfinite(place) | np.isfinite(velocity)

    # A velocity beside a position, and an acceleration beside both, are known in advance.
    way = np.nan_to_num(place - np.array(x.position))
    wanted = np.nan_to_num(velocity) + _shortened(POSITION_GAIN * way, FASTEST)
    missing = np.where(is_followed, VELOCITY_GAIN * (wanted - np.array(x.velocity)), 0.0)
    acceleration = missing + np.nan_to_num(np.array(target.acceleration))
    sideways = _shortened(acceleration[:2], MOST_SIDEWAYS)
    force = np.array([*sideways, max(acceleration[2] + GRAVITY, 0.3 * GRAVITY)])

    # The body's z axis along the force; the yaw is turned to by itself.
    yaw, _, _ = euler_angles(x.attitude)
    ahead = to_body(from_euler(yaw, 0.0, 0.0), force)
    pitch = np.arctan2(ahead[0], ahead[2])
    roll = np.arctan2(-ahead[1], hypot(ahead[0], ahead[2]))
    attitude = from_euler(yaw, float(pitch), float(roll))
    yaw_rate = target.yaw_rate
    if target.yaw is not None:
        missing_yaw = (target.yaw - yaw + np.pi) % (2.0 * np.pi) - np.pi
        yaw_rate = yaw_rate + YAW_GAIN * missing_yaw
    along = to_body(x.attitude, force)[2]
    control = _towards(attitude, (None, None, None), along, x)
    turning = to_body(x.attitude, (0.0, 0.0, yaw_rate))
    wx, wy, wz = (a + b for a, b in zip(control[:3], turning, strict=True))
    return Control(wx, wy, wz, along)


def _shortened(v: np.ndarray, most: float) -> np.ndarray:
    """Return a vector, no longer than `most`."""
    length = float(np.linalg.norm(v))
    return v if length <= most else v * (most / length)
