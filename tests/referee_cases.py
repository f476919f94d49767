"""Gates and paths that the tests of the referee share."""

from itertools import pairwise

import numpy as np

from quadsim.course import Course, Gate, Start
from quadsim.race.referee import Referee

R = 0.11  # vehicle radius [m]
HALF, WIDTH = (0.75, 0.6), 0.275  # half opening, bar [m]
DT = 1 / 400
FAR = ((-1e3, 1e3),) * 3


def gate(position=(0.0, 0.0, 10.0), yaw=0.0, pitch=0.0, roll=0.0):
    return Gate(position, yaw, pitch, roll, (2 * HALF[0], 2 * HALF[1]), WIDTH)


def course(*gates, loop=True, bounds=FAR):
    return Course("test", "", gates, Start((0.0, 0.0, 0.0), 0.0), bounds, loop, 1, (), "")


def make_referee(*gates, laps=1, timeout=1e3, penalties=False, **options):
    return Referee(course(*gates, **options), R, laps, timeout, penalties)


def fly(referee, path, dt=DT, t=0.0, contacts=()):
    """Move through the points of a path, one physics step each."""
    steps = enumerate(pairwise(path))
    return [
        e
        for k, (a, b) in steps
        for e in referee.observe(t + k * dt, a, t + (k + 1) * dt, b, contacts)
    ]


def straight(a, b, speed=30.0, dt=DT):
    """Points from a to b, a step apart."""
    a, b = np.array(a), np.array(b)
    n = max(1, round(np.linalg.norm(b - a) / (speed * dt)))
    return [tuple(p) for p in (a + np.outer(np.arange(n + 1) / n, b - a)).tolist()]


def through(y=0.0, z=10.0, back=False, **options):
    ends = (-2.0, y, z), (2.0, y, z)
    return straight(*(ends[::-1] if back else ends), **options)


def kinds(events):
    return [(e.kind, e.gate) for e in events]
