"""The nominal state: position, velocity and attitude, moved by an inertial measurement unit, in plain floats.

    p' = v,   v' = R(q) (f - b_a) - g e_z,   q' = q x (0, omega - b_g) / 2

f and omega are means over a sample: the attitude turns by omega dt about one axis, f acts along the attitude in
mid-sample.
"""

from __future__ import annotations

from dataclasses import dataclass

from quadsim.sensing.attitude import Vector, rotate, turned
from quadsim.sensing.measurements import Inertial
from quadsim.vehicle import GRAVITY


@dataclass(frozen=True, slots=True)
class Nominal:
    """Position [m], velocity [m/s] and attitude (wxyz) at t, and the unit's biases [m/s^2, rad/s]."""

    t: float
    p: Vector
    v: Vector
    q: Vector
    accelerometer_bias: Vector = (0.0, 0.0, 0.0)
    gyro_bias: Vector = (0.0, 0.0, 0.0)

    def rates(self, sample: Inertial) -> Vector:
        """The body rates of a sample without bias [rad/s].  (3,)"""
        (x, y, z), (a, b, c) = sample.gyro, self.gyro_bias
        return x - a, y - b, z - c

    def force(self, sample: Inertial) -> Vector:
        """The specific force of a sample without bias, in the body frame [m/s^2].  (3,)"""
        (x, y, z), (a, b, c) = sample.specific_force, self.accelerometer_bias
        return x - a, y - b, z - c

    def moved(self, sample: Inertial, until: float) -> Nominal:
        """At `until` [s], the sample's means held from t on."""
        dt = until - self.t
        wx, wy, wz = self.rates(sample)
        half = 0.5 * dt
        middle = turned(self.q, (wx * half, wy * half, wz * half))
        ax, ay, az = rotate(middle, self.force(sample))
        az -= GRAVITY
        (px, py, pz), (vx, vy, vz) = self.p, self.v
        v = vx + ax * dt, vy + ay * dt, vz + az * dt
        p = px + (vx + v[0]) * half, py + (vy + v[1]) * half, pz + (vz + v[2]) * half
        q = turned(self.q, (wx * dt, wy * dt, wz * dt))
        return Nominal(until, p, v, q, self.accelerometer_bias, self.gyro_bias)
