"""Courses, states and paths that the tests of the racing cost share."""

from dataclasses import replace
from itertools import pairwise
from math import radians
from typing import NamedTuple

import numpy as np

from quadsim.controllers.costs import evaluate
from quadsim.controllers.costs.frames import SAFETY_MARGIN
from quadsim.controllers.costs.race import TERMS, RaceWeights
from quadsim.course import FRAME_DEPTH, Course, Gate, Start
from quadsim.dynamics.quadrotor import State

RADIUS = 0.1  # of the vehicle [m]
WIDTH = 0.3  # of a bar of a gate [m]
DT = 0.01  # control period [s]
# Kept from frames, walls and the ground [m].
GAP = RADIUS + SAFETY_MARGIN
# From a gate's plane to where the vehicle is clear of its frame [m].
EXIT = FRAME_DEPTH / 2 + GAP
FAR = ((-1e3, 1e3), (-1e3, 1e3), (0.0, 1e3))
ALL = RaceWeights(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, desired_speed=9.0, margin=0.3)
NOTHING = RaceWeights(progress=0.0, crash=0.0, clearance=0.0)
ONLY = {name: replace(NOTHING, **{name: 1.0}) for name in TERMS}


def gate(x, y=0.0, z=20.0, yaw=0.0, pitch=0.0, roll=0.0, opening=(2.0, 1.6)):
    """Return a gate; angles in degrees."""
    return Gate((x, y, z), radians(yaw), radians(pitch), radians(roll), opening, WIDTH)


def course(*gates, start=(0.0, 0.0, 20.0), loop=False, bounds=FAR, obstacles=()):
    """Return a course without limits that matter."""
    return Course("test", "", gates, Start(start, 0.0), bounds, loop, 1, (), "", obstacles)


# Three gates on a line.
ROW = course(gate(5.0), gate(10.0), gate(15.0))


def state(p, v=(0.0, 0.0, 0.0), q=(1.0, 0.0, 0.0, 0.0)):
    """Return the state at a position, without body rates and thrust."""
    return State(*map(float, p), *v, *q, *(0.0,) * (len(State._fields) - 10))


def term(name, cost, p, v=(0.0, 0.0, 0.0), q=(1.0, 0.0, 0.0, 0.0), row=0):
    """Return one weighted term for a state that stays where it is."""
    x = state(p, v, q)
    return float(evaluate(cost, x, x, (0.0,) * 4, cost.targets[row]).terms[name])


class Flown(NamedTuple):
    """The evaluation of a path by a cost."""

    terms: np.ndarray  # weighted  (steps, terms)
    rows: list[int]  # the target row after each step
    crashes: list[float]  # 1 from the step on in which the sample has crashed


def fly(cost, points):
    """Return what a cost makes of a polyline, a step a segment, by the rollout's bookkeeping."""
    row = 0
    crashed = 0.0
    terms, rows, crashes = [], [], []
    for a, b in pairwise(points):
        velocity = tuple(((np.array(b) - a) / DT).tolist())
        before, after = state(a, velocity), state(b, velocity)
        step = evaluate(cost, before, after, (0.0,) * 4, cost.targets[row], crashed)
        crashed = step.crashed
        row = min(row + int(step.reached), len(cost.targets) - 1)
        terms.append([float(term) for term in step.terms.values()])
        rows.append(row)
        crashes.append(float(crashed))
    return Flown(np.array(terms), rows, crashes)


def straight(a, b, speed=10.0):
    """Return points from a to b, one for each control period at this speed [m/s]."""
    a, b = np.array(a, float), np.array(b, float)
    steps = max(1, round(float(np.linalg.norm(b - a)) / (speed * DT)))
    shares = np.arange(steps + 1) / steps
    return [tuple(p) for p in (a + np.outer(shares, b - a)).tolist()]


def at(g, *offset):
    """Return a point by its offset from a gate's centre: along the passage, left, up."""
    return tuple((g.position + g.rotation @ offset).tolist())


def through(g, y, z, back=False):
    """Return one step of .4 m across a gate's plane, entry and exit, y and z off its centre."""
    ends = [at(g, s, y, z) for s in (-0.2, 0.2)]
    return ends[::-1] if back else ends
