"""The torque of an ideal rate loop."""

from __future__ import annotations

from quadsim.dynamics.quadrotor import rate_loop
from quadsim.rotation import Vec3


def rate_torque(omega: Vec3, omega_cmd: Vec3, gain: Vec3, inertia: Vec3) -> Vec3:
    """Return the torque of the rate loop, J K (omega_cmd - omega) + omega x J omega [N m].

    With K = (1 - exp(-dt/tau)) / dt an explicit Euler step of dt lands exactly on the first-order
    response, 63 % at tau for any dt. The second term cancels the gyroscopic term of the body's
    dynamics.

    Args:
        omega: body rates [rad/s].
        omega_cmd: commanded body rates [rad/s].
        gain: diagonal of K [1/s].
        inertia: principal moments J [kg m^2].
    """
    bx, by, bz = rate_loop(omega, omega_cmd, gain)
    jx, jy, jz = inertia
    gx, gy, gz = gyroscopic(omega, inertia)
    return jx * bx + gx, jy * by + gy, jz * bz + gz


def gyroscopic(omega: Vec3, inertia: Vec3) -> Vec3:
    """Return omega x J omega [N m], for principal moments J [kg m^2]."""
    p, q, r = omega
    jx, jy, jz = inertia
    return (jz - jy) * q * r, (jx - jz) * r * p, (jy - jx) * p * q
