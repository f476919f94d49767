"""What a pilot observes: plain functions over scalars, like the systems, so that lanes and single flights share them.

The state is told in the vehicle's own frame, so that it does not depend on where the course lies or which way it
turns: velocity, direction of gravity, body rates, height, the corners of the next two gates, and the last action.
Everything is divided by a fixed unit that brings it to the order of one; UNITS says by which.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from quadsim.course import Course, Gate
from quadsim.rotation import along, body_axes
from quadsim.systems.quadrotor import CONTROL

SPEED, RATE, LENGTH = 10.0, 10.0, 10.0  # units of velocities [m/s], body rates [rad/s], lengths [m]
AFTER_LAST = 5.0  # from the last gate of an open course to the gate that is shown after it [m]
CORNERS = ("lower right", "upper right", "lower left", "upper left")

_BODY = {f"velocity {axis}": "10 m/s" for axis in "xyz"}
_BODY |= {f"gravity {axis}": "1" for axis in "xyz"}
_BODY |= {f"rate {axis}": "10 rad/s" for axis in "xyz"} | {"height": "10 m"}
_GATES = {f"{gate} gate {corner} {axis}": "10 m" for gate in ("next", "second") for corner in CORNERS for axis in "xyz"}
UNITS = _BODY | _GATES | {f"last {name}": "1" for name in CONTROL}  # observation -> the unit it is told in
SIZE = len(UNITS)
GATE_NUMBERS = 9  # of a gate: centre, and the vectors to the middle of its left and upper edge [m]


def corners(p, axes, gate):
    """The corners of a gate's opening seen from the vehicle, in its frame of these axes, in units of LENGTH.  (12,)"""
    cx, cy, cz, lx, ly, lz, ux, uy, uz = gate
    x, y, z = along(axes, (cx - p[0]) / LENGTH, (cy - p[1]) / LENGTH, (cz - p[2]) / LENGTH)
    a, b, c = along(axes, lx / LENGTH, ly / LENGTH, lz / LENGTH)
    d, e, f = along(axes, ux / LENGTH, uy / LENGTH, uz / LENGTH)
    low_x, low_y, low_z, high_x, high_y, high_z = x - d, y - e, z - f, x + d, y + e, z + f
    return (
        low_x - a, low_y - b, low_z - c, high_x - a, high_y - b, high_z - c,
        low_x + a, low_y + b, low_z + c, high_x + a, high_y + b, high_z + c,
    )  # fmt: skip


def observation(x, gates, last):
    """See UNITS.  x: STATE; gates: the numbers of the next two gates (18,); last: the last action, in -1..1 (4,)."""
    px, py, pz, vx, vy, vz, qw, qx, qy, qz, wx, wy, wz, _a, _bx, _by, _bz = x
    g0, g1, g2, g3, g4, g5, g6, g7, g8, h0, h1, h2, h3, h4, h5, h6, h7, h8 = gates
    p, axes = (px, py, pz), body_axes((qw, qx, qy, qz))
    v = along(axes, vx / SPEED, vy / SPEED, vz / SPEED)
    a = corners(p, axes, (g0, g1, g2, g3, g4, g5, g6, g7, g8))
    b = corners(p, axes, (h0, h1, h2, h3, h4, h5, h6, h7, h8))
    return (
        v[0], v[1], v[2], -axes[2], -axes[5], -axes[8], wx / RATE, wy / RATE, wz / RATE, pz / LENGTH,
        a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8], a[9], a[10], a[11],
        b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7], b[8], b[9], b[10], b[11],
        last[0], last[1], last[2], last[3],
    )  # fmt: skip


def gate_rows(course: Course, laps: int) -> np.ndarray:
    """The next two gates for each number of gates passed, up to all of them.  (laps * gates + 1, 18)"""
    gates = [gate_numbers(g) for g in course.gates]
    last, passage = np.array(gates[-1]), course.gates[-1].rotation[:, 0]
    behind = [last + np.concatenate([k * AFTER_LAST * passage, np.zeros(6)]) for k in (1, 2)]
    after = [gates[0], gates[1 % len(gates)]] if course.loop else behind
    rows = np.array([*gates * laps, *after])
    return np.hstack([rows[:-1], rows[1:]])


def gate_numbers(gate: Gate) -> tuple[float, ...]:
    """Centre, and the vectors to the middle of the left and the upper edge [m].  (9,)"""
    half_width, half_height = gate.opening[0] / 2, gate.opening[1] / 2
    left, up = half_width * gate.rotation[:, 1], half_height * gate.rotation[:, 2]
    return (*gate.position, *left.tolist(), *up.tolist())


def normalised(u: Sequence[float] | np.ndarray, low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    """A command as an action in -1..1."""
    lower, upper = np.asarray(low), np.asarray(high)
    return 2 * (np.asarray(u) - lower) / (upper - lower) - 1


def command(action: Sequence[float] | np.ndarray, low: Sequence[float], high: Sequence[float]) -> np.ndarray:
    """An action in -1..1 as a command: body rates [rad/s] and thrust [m/s^2]."""
    lower, upper = np.asarray(low), np.asarray(high)
    return lower + (np.clip(action, -1, 1) + 1) / 2 * (upper - lower)
