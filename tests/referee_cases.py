"""Gates and paths that the tests of the referee share."""

from itertools import pairwise

import numpy as np

from quadsim.course import Course, Gate, Start
from quadsim.racing.referee import Referee

R = 0.11  # vehicle radius [m]
HALF = (0.75, 0.6)  # half opening [m]
WIDTH = 0.275  # of a bar [m]
DT = 1 / 400  # physics step [s]
FAR = ((-1e3, 1e3),) * 3


def gate(position=(0.0, 0.0, 10.0), yaw=0.0, pitch=0.0, roll=0.0):
    """Return a gate; angles in radians."""
    return Gate(position, yaw, pitch, roll, (2 * HALF[0], 2 * HALF[1]), WIDTH)


def course(*gates, loop=True, bounds=FAR):
    """Return a course, without bounds that matter."""
    return Course("test", "", gates, Start((0.0, 0.0, 0.0), 0.0), bounds, loop, 1, (), "")


def make_referee(*gates, laps=1, timeout=1e3, penalties=False, **options):
    """Return the referee of a course with these gates."""
    return Referee(course(*gates, **options), R, laps, timeout, penalties)


def fly(referee, path, dt=DT, t=0.0, contacts=()):
    """Move through the points of a path, one physics step each. Return the events."""
    events = []
    for k, (a, b) in enumerate(pairwise(path)):
        events += referee.observe(t + k * dt, a, t + (k + 1) * dt, b, contacts)
    return events


def straight(a, b, speed=30.0, dt=DT):
    """Return points from a to b, a physics step apart at this speed [m/s]."""
    a, b = np.array(a), np.array(b)
    steps = max(1, round(np.linalg.norm(b - a) / (speed * dt)))
    shares = np.arange(steps + 1) / steps
    return [tuple(p) for p in (a + np.outer(shares, b - a)).tolist()]


def through(y=0.0, z=10.0, back=False, **options):
    """Return a path along x through a gate at the origin."""
    ends = (-2.0, y, z), (2.0, y, z)
    return straight(*(ends[::-1] if back else ends), **options)


def kinds(events):
    """Return kind and gate of each event."""
    return [(e.kind, e.gate) for e in events]
