"""Messages of the vehicle's state, from the true state or from what sensors have measured."""

from __future__ import annotations

from math import cos, degrees, radians
from typing import NamedTuple

from quadsim.mavlink.axes import frd, ned, ned_attitude
from quadsim.mavlink.messages import (
    ActuatorOutputStatus,
    Attitude,
    GlobalPositionInt,
    HighresImu,
    HomePosition,
    LocalPositionNed,
    Odometry,
)
from quadsim.rotation import Quaternion, Vec3, euler_angles
from quadsim.sensing.measurements import Inertial
from quadsim.vehicle import Vehicle

LOCAL_NED = 1  # MAV_FRAME_LOCAL_NED
BODY_FRD = 12  # MAV_FRAME_BODY_FRD
# HIGHRES_IMU.fields_updated: accelerometer, gyroscope, height by pressure
UPDATED = 0b0000_0011_1111 | 1 << 11
MOTORS = 4
# Where the course's origin lies on the globe, as messages of latitude and longitude need a place:
# the home of PX4's simulations [deg], [m]
LATITUDE = 47.397742
LONGITUDE = 8.545594
ALTITUDE = 488.0
# Length of a degree of latitude [m]
DEGREE = 111319.49


class Motion(NamedTuple):
    """Pose and motion, in the axes of quadsim."""

    position: Vec3  # [m]
    velocity: Vec3  # in the world [m/s]
    attitude: Quaternion
    body_rates: Vec3  # [rad/s]


def attitude_message(motion: Motion, boot: float) -> Attitude:
    """Return ATTITUDE; `boot` is the time since the simulator's start [s]."""
    yaw, pitch, roll = euler_angles(ned_attitude(motion.attitude))
    return Attitude(_ms(boot), roll, pitch, yaw, *frd(motion.body_rates))


def position_message(motion: Motion, boot: float) -> LocalPositionNed:
    """Return LOCAL_POSITION_NED; the origin is the course's."""
    return LocalPositionNed(_ms(boot), *ned(motion.position), *ned(motion.velocity))


def global_position_message(motion: Motion, boot: float) -> GlobalPositionInt:
    """Return GLOBAL_POSITION_INT, with the course's origin at a place of our choice."""
    yaw, _, _ = euler_angles(ned_attitude(motion.attitude))
    latitude, longitude, altitude = _on_globe(motion.position)
    speeds = [min(max(round(100.0 * v), -32768), 32767) for v in ned(motion.velocity)]
    return GlobalPositionInt(
        _ms(boot),
        latitude,
        longitude,
        altitude,
        round(1e3 * motion.position[2]),
        *speeds,
        hdg=round(100.0 * degrees(yaw)) % 36000,
    )


def home_message(start: Vec3) -> HomePosition:
    """Return HOME_POSITION. start: where the vehicle starts, east north up [m]."""
    level = (1.0, 0.0, 0.0, 0.0)
    return HomePosition(*_on_globe(start), *ned(start), q=level)


def _on_globe(position: Vec3) -> tuple[int, int, int]:
    """Return latitude and longitude [1e-7 deg] and altitude [mm] of a position of the course."""
    east, north, up = position
    latitude = LATITUDE + north / DEGREE
    longitude = LONGITUDE + east / (DEGREE * cos(radians(LATITUDE)))
    return round(1e7 * latitude), round(1e7 * longitude), round(1e3 * (ALTITUDE + up))


def odometry_message(motion: Motion, boot: float, resets: int) -> Odometry:
    """Return ODOMETRY: pose and velocity north-east-down, body rates forward-right-down.

    MAVLink has the velocity in the axes of `child_frame_id`, the body's. Teams' clients use it as
    one of the world, beside a pose in LOCAL_NED, and so does this message.

    Args:
        motion: pose and motion.
        boot: time since the simulator's start [s].
        resets: how often the vehicle was put back to the start.
    """
    return Odometry(
        _us(boot),
        LOCAL_NED,
        BODY_FRD,
        *ned(motion.position),
        ned_attitude(motion.attitude),
        *ned(motion.velocity),
        *frd(motion.body_rates),
        reset_counter=resets % 256,
    )


def imu_message(sample: Inertial, height: float, boot: float) -> HighresImu:
    """Return HIGHRES_IMU; at rest the specific force is (0, 0, -9.81) m/s^2.

    Args:
        sample: the sample of the inertial unit.
        height: height by the barometer [m].
        boot: time since the simulator's start, at the end of the sample [s].
    """
    force = frd(sample.specific_force)
    rates = frd(sample.gyro)
    return HighresImu(_us(boot), *force, *rates, pressure_alt=height, fields_updated=UPDATED)


def motors_message(thrust: float, vehicle: Vehicle, boot: float) -> ActuatorOutputStatus:
    """Return ACTUATOR_OUTPUT_STATUS: the mean share of full thrust, for each motor.

    Args:
        thrust: thrust of the vehicle [m/s^2].
        vehicle: the vehicle.
        boot: time since the simulator's start [s].
    """
    share = thrust / vehicle.thrust_max
    return ActuatorOutputStatus(_us(boot), MOTORS, MOTORS * (share,) + (32 - MOTORS) * (0.0,))


def _ms(t: float) -> int:
    """Return a time in milliseconds, as 32 bits hold it."""
    return round(1e3 * t) % 2**32


def _us(t: float) -> int:
    """Return a time in microseconds."""
    return round(1e6 * t)
