"""The cost of following a reference: an optimised race of the same vehicle on the same course.

    q = a_1 (1 + a_g g) |e_c|^2 + a_2 |v - v_r|^2 - a_3 tau + a_4 Crash,    p - p_r = e_c + tau v_r

The reference is one state for each control period, p_r and v_r; e_c is the distance across its
path, tau the time by which a sample is ahead of the reference [s], g is 1 at a gate and decays
before and behind it. This is contouring control (Lam, Manzie and Good, CDC 2010) with the
reference's own timing, and, as in MPCC for quadrotors (Romero, Sun, Foehn and Scaramuzza, T-RO
2022), with a weight that rises at gates. Every plan begins at the state of the reference nearest to
the vehicle, so that a late vehicle follows the same path later.

Frames, obstacles and the ground are treated as in the racing cost. Only the reference leads through
the gates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from quadsim.controllers.costs import Cost, Term, crash
from quadsim.controllers.costs.frames import course_obstacles
from quadsim.controllers.costs.race import Weight
from quadsim.controllers.costs.room import leaves_room, room_to_fly
from quadsim.course import Course
from quadsim.files.strict_yaml import setting
from quadsim.files.values import check_fields

GATE_TIME = 0.06  # time before and behind a gate in which g falls to exp(-1/2) [s]
AT_REST = 1.0  # added to the divisor |v_r|^2 of tau [m^2/s^2]
# Weight of a difference in velocity relative to a distance in the search of the nearest state [s]
VELOCITY_WEIGHT = 0.1
BEYOND = 15  # number of rows beyond the leg to the next gate in the search of the nearest state
AFTER = 10.0  # time of the reference behind the finish, so that plans continue there [s]
ACCELERATING = 1.0  # time behind the finish with the last acceleration [s]
LAST_ROWS = 5  # number of rows for the estimate of the last acceleration


@dataclass(frozen=True)
class ReferenceWeights:
    """Weights a_1, a_g, a_2..a_4 of the terms, and the solution to follow."""

    off_path: Annotated[Weight, setting("weight per m^2 of squared distance to the path")] = 10.0
    at_gates: Annotated[Weight, setting("relative increase of off_path at a gate's plane")] = 60.0
    velocity: Annotated[
        Weight, setting("weight per (m/s)^2 of squared velocity error to the reference")
    ] = 3.0
    ahead: Annotated[Weight, setting("reward per second ahead of the reference")] = 20.0
    crash: Annotated[Weight, setting("weight per step after a crash")] = 1000.0
    margin: Annotated[
        float,
        setting(
            "margin of the solution to follow, the --margin of `race limit`",
            unit="m",
            ge=0,
            le=1,
        ),
    ] = 0.03
    reserve: Annotated[
        float,
        setting("reserve of the solution to follow, the --reserve of `race limit`", ge=0, le=0.2),
    ] = 0.002

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, eq=False)
class Reference:
    """A race as a sequence of states, one per control period dt."""

    x: np.ndarray  # position and velocity [m, m/s]  (rows, 6)
    u: np.ndarray  # controls  (rows, 4)
    passes: tuple[int, ...]  # row at each gate
    dt: float  # control period [s]

    @classmethod
    def of(cls, x: np.ndarray, u: np.ndarray, passes: Sequence[int], dt: float) -> Reference:
        """Return a reference with an extension beyond the finish.

        The extension keeps the last acceleration for a second and then flies straight.

        Args:
            x: position and velocity [m, m/s]  (rows, 6).
            u: controls  (rows, 4).
            passes: row at each gate.
            dt: control period [s].
        """
        p, v = x[-1, :3], x[-1, 3:]
        a = (v - x[-1 - LAST_ROWS, 3:]) / (LAST_ROWS * dt)
        t = dt * np.arange(1, round(AFTER / dt))[:, None]
        accelerating = np.minimum(t, ACCELERATING)
        positions = p + t * v + a * accelerating * (t - accelerating / 2)
        velocities = v + accelerating * a
        beyond = np.hstack([positions, velocities])
        return cls(
            x=np.vstack([x, beyond]),
            u=np.vstack([u, np.repeat(u[-1:], len(t), axis=0)]),
            passes=tuple(passes),
            dt=dt,
        )

    def at_gates(self) -> np.ndarray:
        """Return g of every row.  (rows,)"""
        seconds = self.dt * (np.arange(len(self.x))[:, None] - np.array(self.passes))
        return np.exp(-0.5 * (seconds / GATE_TIME) ** 2).max(axis=1)

    def nearest(self, target: int, x: np.ndarray) -> int:
        """Return the row of the state nearest to x on the way to a target.

        Args:
            target: number of gates passed.
            x: state, position and velocity first  (n_x,).
        """
        legs = (0, *self.passes, len(self.x))
        begin = legs[min(target, len(legs) - 2)]
        end = legs[min(target + 1, len(legs) - 1)]
        first = max(begin - BEYOND, 0)
        last = end + BEYOND
        apart = self.x[first:last] - x[:6]
        weights = [1.0] * 3 + [VELOCITY_WEIGHT**2] * 3
        return first + int((apart * apart @ weights).argmin())

    def row_ahead(self, target: int, x: np.ndarray) -> int:
        """Return the row of the reference for the first step of a plan from x."""
        return self.nearest(target, x) + 1

    def controls(self, target: int, x: np.ndarray, horizon: int) -> np.ndarray:
        """Return the reference's controls from its state nearest to x onwards.  (T, n_u)

        Beyond the end of the reference its last control is repeated.
        """
        rows = self.nearest(target, x) + np.arange(horizon)
        return self.u[np.minimum(rows, len(self.u) - 1)]


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
    """The parameters of the terms, and the room in which samples may fly [m]."""

    at_gates: float  # a_g

    # The fields of quadsim.controllers.costs.room.Room
    floor: float
    x_low: float
    x_high: float
    y_low: float
    y_high: float
    z_high: float


def time_ahead(x_next, target):
    """Return tau, the time of the sample ahead of the reference [s]."""
    dx = x_next.px - target.x
    dy = x_next.py - target.y
    dz = x_next.pz - target.z
    speed2 = target.vx * target.vx + target.vy * target.vy + target.vz * target.vz
    return (dx * target.vx + dy * target.vy + dz * target.vz) / (speed2 + AT_REST)


def reached(x, x_next, u, target, p):
    """Return True, as every step advances to the next row."""
    return True


def crashes(x, x_next, u, target, p):
    """Return whether the step touches the ground or leaves the bounds."""
    return leaves_room(x, x_next, p)


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
    """Return the cost of following a reference.

    Args:
        course: the course with frames, obstacles and bounds.
        radius: radius of the vehicle [m].
        weights: weights of the terms.
        reference: the race to follow.
    """
    room = room_to_fly(course, radius, margin=0.0)
    return Cost(
        name="reference",
        terms=tuple(Term(term, getattr(weights, term.__name__)) for term in REFERENCE_TERMS),
        row=ReferenceTarget,
        targets=np.column_stack([reference.x, reference.at_gates()]),
        params=ReferenceParams(at_gates=weights.at_gates, **room._asdict()),
        reached=reached,
        crash=crashes,
        obstacles=course_obstacles(course, radius),
        row_ahead=reference.row_ahead,
        guide=reference.controls,
    )
