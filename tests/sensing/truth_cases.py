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


def circle(t):
    """The state at t [s]: thrust along body z, the nose towards the middle."""
    return on_circle(np.array([t]))[0]


@cache
def states(seconds):
    """Return the states of the first seconds, a physics step apart."""
    return on_circle(DT * np.arange(round(seconds / DT) + 1))


def on_circle(t):
    """Return the states at some times  (n,) [s]."""
    c, s, nought = np.cos(RATE * t), np.sin(RATE * t), np.zeros_like(t)
    p = RADIUS * np.column_stack([c, s, nought])
    v = RADIUS * RATE * np.column_stack([-s, c, nought])
    up = -(RATE**2) * p + np.array([0.0, 0.0, GRAVITY])
    thrust = np.linalg.norm(up, axis=1)
    z = up / thrust[:, None]
    x = np.column_stack([-c, -s, nought])
    x -= np.sum(x * z, axis=1)[:, None] * z
    x /= np.linalg.norm(x, axis=1)[:, None]
    R = np.stack([x, np.cross(z, x), z], axis=2)
    q = Rotation.from_matrix(R).as_quat(scalar_first=True)
    p[:, 2] += HEIGHT
    rows = np.column_stack([p, v, q, *[nought] * 3, thrust, *[nought] * 3])
    return [
        PlantState(time, State(*row), ())
        for time, row in zip(t.tolist(), rows.tolist(), strict=True)
    ]
