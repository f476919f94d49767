"""Courses, states and flights that the tests of the racing cost share."""

from dataclasses import replace
from itertools import pairwise
from math import radians

import numpy as np

from controllers.costs import evaluate
from controllers.costs.frames import SAFETY_MARGIN
from controllers.costs.race import TERMS, RaceWeights
from quadsim.course import FRAME_DEPTH, Course, Gate, Start
from quadsim.dynamics.quadrotor import State

RADIUS, WIDTH, DT = 0.1, 0.3, 0.01
GAP = RADIUS + SAFETY_MARGIN  # kept from frames, walls and the ground
EXIT = FRAME_DEPTH / 2 + GAP  # behind a gate's plane, and the entry in front of it
FAR = ((-1e3, 1e3), (-1e3, 1e3), (0.0, 1e3))
ALL = RaceWeights(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, desired_speed=9.0, margin=0.3)
NOTHING = RaceWeights(progress=0.0, crash=0.0, clearance=0.0)
ONLY = {name: replace(NOTHING, **{name: 1.0}) for name in TERMS}


def gate(x, y=0.0, z=20.0, yaw=0.0, pitch=0.0, roll=0.0, opening=(2.0, 1.6)):
    return Gate((x, y, z), radians(yaw), radians(pitch), radians(roll), opening, WIDTH)


def course(*gates, start=(0.0, 0.0, 20.0), loop=False, bounds=FAR, obstacles=()):
    return Course("test", "", gates, Start(start, 0.0), bounds, loop, 1, (), "", obstacles)


ROW = course(gate(5.0), gate(10.0), gate(15.0))  # three gates on a line


def state(p, v=(0.0, 0.0, 0.0), q=(1.0, 0.0, 0.0, 0.0)):
    return State(*map(float, p), *v, *q, *(0.0,) * (len(State._fields) - 10))


def term(name, cost, p, v=(0.0, 0.0, 0.0), q=(1.0, 0.0, 0.0, 0.0), row=0):
    """One weighted term for a state that stays where it is."""
    x = state(p, v, q)
    return float(evaluate(cost, x, x, (0.0,) * 4, cost.targets[row]).terms[name])


def fly(cost, points):
    """Along a polyline, a step a segment, with the rollout's bookkeeping.  -> (steps, terms), rows,
    crashed"""
    row, crashed, q, rows, crashes = 0, 0.0, [], [], []
    for a, b in pairwise(points):
        v = tuple(((np.array(b) - a) / DT).tolist())
        step = evaluate(cost, state(a, v), state(b, v), (0.0,) * 4, cost.targets[row], crashed)
        crashed = step.crashed
        row = min(row + int(step.reached), len(cost.targets) - 1)
        q, rows, crashes = (
            [*q, [float(t) for t in step.terms.values()]],
            [*rows, row],
            [*crashes, float(crashed)],
        )
    return np.array(q), rows, crashes


def straight(a, b, speed=10.0):
    a, b = np.array(a, float), np.array(b, float)
    n = max(1, round(float(np.linalg.norm(b - a)) / (speed * DT)))
    return [tuple(p) for p in (a + np.outer(np.arange(n + 1) / n, b - a)).tolist()]


def at(g, *offset):
    """A point by its offset from a gate's centre: along the passage, left, up."""
    return tuple((g.position + g.rotation @ offset).tolist())


def through(g, y, z, back=False):
    """One step of .4 m across a gate, its plane, entry and exit, y and z off its centre."""
    ends = [at(g, s, y, z) for s in (-0.2, 0.2)]
    return ends[::-1] if back else ends
