"""The cost of following a reference: a race that was optimised before, of the same vehicle on the
same course.

    q = a_1 (1 + a_g g) |e_c|^2 + a_2 |v - v_r|^2 - a_3 tau + a_4 Crash,    p - p_r = e_c + tau v_r

The reference is one state for each control period, p_r and v_r; e_c is the distance across its
path, tau by how much time a sample is ahead on it [s], g is 1 at a gate and falls off before and
behind it. That is contouring control (Lam, Manzie and Good, CDC 2010) with the reference's own
timing, and, as in MPCC for quadrotors (Romero, Sun, Foehn and Scaramuzza, T-RO 2022), with a weight
that rises at gates. Every plan begins at the state of the reference nearest to the vehicle, so that
a vehicle that is late follows the same path later.

Frames, obstacles and the ground are what they are in the racing cost; that gates are passed is left
to the reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from controllers.costs import Cost, Term, crash
from controllers.costs.frames import course_obstacles
from controllers.costs.race import Weight, room_to_fly
from quadsim.course import Course
from quadsim.files.strict_yaml import setting

GATE_TIME = 0.06  # [s] before and behind a gate in which g falls to exp(-1/2)
AT_REST = 1.0  # [m^2/s^2] added to |v_r|^2, which tau divides by
# [s] what a difference in velocity counts as a distance when the nearest state is searched
VELOCITY_WEIGHT = 0.1
BEYOND = 15  # [rows] around the leg to the next gate within which it is searched
AFTER = 10.0  # [s] of the reference behind the finish, so that no plan ends there
ACCELERATING = 1.0  # [s] of these with the last acceleration


@dataclass(frozen=True)
class ReferenceWeights:
    """Weights a_1, a_g, a_2..a_4 of the terms, and which solution of `race limit --model rates` is
    followed."""

    off_path: Annotated[Weight, setting("per m^2 across the path")] = 10.0
    at_gates: Annotated[Weight, setting("by how many times more at a gate's plane")] = 60.0
    velocity: Annotated[Weight, setting("per (m/s)^2 off the reference's velocity")] = 3.0
    ahead: Annotated[Weight, setting("reward per second ahead")] = 20.0
    crash: Annotated[Weight, setting("per step after a crash")] = 1000.0
    margin: Annotated[
        float, setting("of the solution to the frames, its --margin [m]", unit="m", ge=0, le=1)
    ] = 0.03
    reserve: Annotated[float, setting("of its thrust, its --reserve", ge=0, le=0.2)] = 0.002


@dataclass(frozen=True, eq=False)
class Reference:
    """A race by its state at every control period dt [s]."""

    x: np.ndarray  # (rows, 6) position and velocity [m, m/s]
    u: np.ndarray  # (rows, 4) controls
    passes: tuple[int, ...]  # row at each gate
    dt: float

    @classmethod
    def of(cls, x: np.ndarray, u: np.ndarray, passes: Sequence[int], dt: float) -> Reference:
        """With a way on behind the finish, under the last acceleration for a second and then
        straight. x (rows, 6), u (rows, 4), dt: control period [s]."""
        p, v = x[-1, :3], x[-1, 3:]
        t = dt * np.arange(1, round(AFTER / dt))[:, None]
        a, on = (v - x[-6, 3:]) / (5 * dt), np.minimum(t, ACCELERATING)
        beyond = np.hstack([p + t * v + a * on * (t - on / 2), v + on * a])
        return cls(
            np.vstack([x, beyond]),
            np.vstack([u, np.repeat(u[-1:], len(t), axis=0)]),
            tuple(passes),
            dt,
        )

    def at_gates(self) -> np.ndarray:
        """g of every row.  (rows,)"""
        seconds = self.dt * (np.arange(len(self.x))[:, None] - np.array(self.passes))
        return np.exp(-0.5 * (seconds / GATE_TIME) ** 2).max(axis=1)

    def nearest(self, target: int, x: np.ndarray) -> int:
        """Row of the state nearest to x (n_x,), on the way to this target."""
        legs = (0, *self.passes, len(self.x))
        first = max(legs[min(target, len(legs) - 2)] - BEYOND, 0)
        last = legs[min(target + 1, len(legs) - 1)] + BEYOND
        apart = self.x[first:last] - x[:6]
        return first + int((apart * apart @ ([1.0] * 3 + [VELOCITY_WEIGHT**2] * 3)).argmin())

    def row_ahead(self, target: int, x: np.ndarray) -> int:
        """Row of the first state that a plan from x is compared with."""
        return self.nearest(target, x) + 1

    def controls(self, target: int, x: np.ndarray, horizon: int) -> np.ndarray:
        """The reference's own from x on.  (T, n_u)"""
        rows = self.nearest(target, x) + np.arange(horizon)
        return self.u[np.minimum(rows, len(self.u) - 1)]  # a long plan goes on with the last one


class ReferenceTarget(NamedTuple):
    """The target row: the reference at one control period."""

    x: float  # position p_r [m]
    y: float
    z: float
    vx: float  # velocity v_r [m/s]
    vy: float
    vz: float
    at_gate: float  # g, 1 at a gate's plane


class ReferenceParams(NamedTuple):
    """The numbers that the terms refer to, and where samples may fly."""

    at_gates: float  # a_g
    floor: float  # [m]
    x_low: float
    x_high: float
    y_low: float
    y_high: float
    z_high: float


def time_ahead(x_next, target):
    """Return tau, by how much time the sample is ahead of the reference [s]."""
    dx = x_next.px - target.x
    dy = x_next.py - target.y
    dz = x_next.pz - target.z
    speed2 = target.vx * target.vx + target.vy * target.vy + target.vz * target.vz
    return (dx * target.vx + dy * target.vy + dz * target.vz) / (speed2 + AT_REST)


def reached(x, x_next, u, target, p):
    """Return that every step reaches its target: the next is the next step's."""
    return True


def crashes(x, x_next, u, target, p):
    """Return whether the step touches the ground or the bounds."""
    pz = x_next.pz
    below_floor = (pz < p.floor) & (pz < x.pz)  # a start on the ground is no crash
    out_x = (x_next.px < p.x_low) | (x_next.px > p.x_high)
    return below_floor | (out_x | (x_next.py < p.y_low) | (x_next.py > p.y_high) | (pz > p.z_high))


def off_path(x, x_next, u, target, p):
    """Return the square of the distance across the path, weighted more at gates [m^2]."""
    tau = time_ahead(x_next, target)
    cx = x_next.px - target.x - tau * target.vx
    cy = x_next.py - target.y - tau * target.vy
    cz = x_next.pz - target.z - tau * target.vz
    return (1.0 + p.at_gates * target.at_gate) * (cx * cx + cy * cy + cz * cz)


def velocity(x, x_next, u, target, p):
    """Return the square of the difference to the reference's velocity [(m/s)^2]."""
    ex = x_next.vx - target.vx
    ey = x_next.vy - target.vy
    ez = x_next.vz - target.vz
    return ex * ex + ey * ey + ez * ez


def ahead(x, x_next, u, target, p):
    """Return minus the time ahead of the reference [s]: a reward."""
    return -time_ahead(x_next, target)


REFERENCE_TERMS = (off_path, velocity, ahead, crash)
TERMS = tuple(term.__name__ for term in REFERENCE_TERMS)


def reference_cost(
    course: Course, radius: float, weights: ReferenceWeights, reference: Reference
) -> Cost:
    """Return the cost of following the reference on this course for a vehicle of this radius
    [m]."""
    w = weights
    return Cost(
        name="reference",
        terms=tuple(Term(function, getattr(w, function.__name__)) for function in REFERENCE_TERMS),
        row=ReferenceTarget,
        targets=np.column_stack([reference.x, reference.at_gates()]),
        params=ReferenceParams(w.at_gates, *room_to_fly(course, radius, 0.0)),
        reached=reached,
        crash=crashes,
        obstacles=course_obstacles(course, radius),
        row_ahead=reference.row_ahead,
        guide=reference.controls,
    )
