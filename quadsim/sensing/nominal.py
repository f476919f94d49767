"""The nominal state, which an inertial unit propagates: position, velocity and attitude.

    p' = v,   v' = R(q) (f - b_a) - g e_z,   q' = q x (0, omega - b_g) / 2

f and omega are means over a sample: the attitude turns by omega dt about one axis, and f acts along
the attitude in mid-sample. The numbers are plain floats.
"""

from __future__ import annotations

from dataclasses import dataclass

from quadsim.rotation import Quaternion, Vec3, to_world, turned
from quadsim.sensing.measurements import Inertial
from quadsim.vehicle import GRAVITY


@dataclass(frozen=True, slots=True)
class Nominal:
    """The state that is integrated from an inertial unit's samples, and the unit's biases."""

    # [s]
    t: float
    # in the world [m]
    position: Vec3
    # in the world [m/s]
    velocity: Vec3
    # wxyz
    attitude: Quaternion
    # [m/s^2]
    accelerometer_bias: Vec3 = (0.0, 0.0, 0.0)
    # [rad/s]
    gyro_bias: Vec3 = (0.0, 0.0, 0.0)

    def rates(self, sample: Inertial) -> Vec3:
        """Return the bias-corrected body rates of a sample [rad/s].  (3,)"""
        wx, wy, wz = sample.gyro
        bx, by, bz = self.gyro_bias
        return wx - bx, wy - by, wz - bz

    def force(self, sample: Inertial) -> Vec3:
        """Return the bias-corrected specific force of a sample, body frame [m/s^2].  (3,)"""
        fx, fy, fz = sample.specific_force
        bx, by, bz = self.accelerometer_bias
        return fx - bx, fy - by, fz - bz

    def moved(self, sample: Inertial, until: float) -> Nominal:
        """Return the state at the time `until` [s], with the sample held constant from t on."""
        dt = until - self.t
        half = 0.5 * dt
        wx, wy, wz = self.rates(sample)

        # The force acts along the attitude in the middle of the interval.
        middle = turned(self.attitude, (wx * half, wy * half, wz * half))
        ax, ay, az = to_world(middle, self.force(sample))
        az -= GRAVITY
        vx, vy, vz = self.velocity
        velocity = (vx + ax * dt, vy + ay * dt, vz + az * dt)

        # The position changes by the mean of the old and the new velocity.
        px, py, pz = self.position
        position = (
            px + (vx + velocity[0]) * half,
            py + (vy + velocity[1]) * half,
            pz + (vz + velocity[2]) * half,
        )
        attitude = turned(self.attitude, (wx * dt, wy * dt, wz * dt))
        return Nominal(until, position, velocity, attitude, self.accelerometer_bias, self.gyro_bias)
