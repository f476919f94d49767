"""A flight without plant or planner: a circle, known exactly, that looks at its middle."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from quadsim.course import Gate
from quadsim.dynamics.quadrotor import State
from quadsim.physics.plant_state import PlantState
from quadsim.vehicle import GRAVITY

RADIUS, HEIGHT, RATE = 5.0, 2.0, 0.8  # [m, m, rad/s]
GATES = tuple(
    Gate((0.0, y, 1.5 + 0.3 * y), yaw, 0.0, 0.0, (1.5, 1.5), 0.275)
    for y, yaw in ((-1.2, 0.3), (1.4, -0.4))
)
DT = 1 / 400


@cache
def circle(t):
    """The state at t [s]: thrust along body z, the nose towards the middle."""
    c, s = np.cos(RATE * t), np.sin(RATE * t)
    p, v = RADIUS * np.array([c, s, 0.0]), RADIUS * RATE * np.array([-s, c, 0.0])
    up = -(RATE**2) * p + np.array([0.0, 0.0, GRAVITY])
    z = up / np.linalg.norm(up)
    x = np.array([-c, -s, 0.0]) - (np.array([-c, -s, 0.0]) @ z) * z
    x /= np.linalg.norm(x)
    R = np.column_stack([x, np.cross(z, x), z])
    p[2] += HEIGHT
    state = (
        *p.tolist(),
        *v.tolist(),
        *Rotation.from_matrix(R).as_quat(scalar_first=True).tolist(),
        0.0,
        0.0,
        0.0,
        float(np.linalg.norm(up)),
        0.0,
        0.0,
        0.0,
    )
    return PlantState(t, State(*map(float, state)), ())


def states(seconds):
    """Return the states of the first seconds, a physics step apart."""
    return [circle(k * DT) for k in range(round(seconds / DT) + 1)]
