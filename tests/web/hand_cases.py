"""A scripted pilot: sticks that fly slowly along the middle line of a wide course."""

from math import atan2, hypot, pi

import numpy as np

from quadsim.racing.hand import HandRates, Sticks
from quadsim.rotation import matrix
from quadsim.vehicle import GRAVITY, load_vehicle

SPEED = 3.0  # [m/s]
# Two wide gates, the second one to the left: four seconds of flight
WIDE = """\
source: made for this test
loop: false
laps: 1
opening: [4, 3]
frame_width: 0.3
bounds: [[-5, 15], [-10, 10], [-1, 9]]
start: {position: [0, 0, 2], yaw_deg: 0}
gates:
  - {position: [4, 0, 2], yaw_deg: 0}
  - {position: [8, 1.5, 2], yaw_deg: 45}
"""


def sticks(course, x, passed, rates=None):
    """Return the sticks of a pilot who sees the state x.

    x: position, velocity, quaternion wxyz, body rates.
    """
    rates = rates or HandRates.of(load_vehicle("swift"))
    p, v, q = np.array(x[:3]), np.array(x[3:6]), x[6:10]
    gate = course.gates[passed % len(course.gates)]
    gate_p = np.array(gate.position)
    along = np.array(gate.axes[0])

    # Where to fly: to a point before the gate, moving through it with the vehicle
    behind = float((gate_p - p) @ along)
    aim = gate_p - along * np.clip(0.5 * behind, -2.0, 3.0) if behind > 0 else gate_p + 2.0 * along
    way = aim - p
    way /= max(np.linalg.norm(way), 1e-6)
    wanted_v = SPEED * way
    wanted_v[2] = 1.5 * (gate_p[2] - p[2])

    # Acceleration, which the thrust gives
    a = 1.2 * (wanted_v - v) + 0.4 * v
    a[2] += GRAVITY
    flat = hypot(a[0], a[1])
    most = 0.4 * a[2]
    if flat > most:
        a[:2] *= most / flat
    R = matrix(q)
    up = R[:, 2]
    thrust = float(a @ up)

    # Body rates that turn the thrust there, and the nose along the way
    goal = a / np.linalg.norm(a)
    turn = R.T @ np.cross(up, goal)
    heading = atan2(R[1, 0], R[0, 0])
    ahead = atan2(way[1], way[0])
    off = (ahead - heading + pi) % (2 * pi) - pi
    omega = (3.5 * turn[0], 3.5 * turn[1], float(np.clip(1.5 * off, -1.5, 1.5)))

    return Sticks(
        roll=deflection(rates.roll, omega[0]),
        pitch=deflection(rates.pitch, omega[1]),
        yaw=-deflection(rates.yaw, omega[2]),
        throttle=float(np.clip(max(thrust, 0.0) / rates.thrust, 0.0, 1.0) ** 0.5),
    )


def deflection(rates, omega):
    """Return the deflection of a stick for a body rate [rad/s]."""
    positions = np.linspace(-1.0, 1.0, 2001)
    curve = np.array([rates.rate(p) for p in positions])
    return float(np.interp(omega, curve, positions))
