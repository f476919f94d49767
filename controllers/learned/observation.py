"""The observations of a learned pilot, as plain functions over scalars like the models.

The compiled lanes and single flights share these functions. The state is given in the body frame,
so that it does not depend on position and heading of the course: velocity, direction of gravity,
body rates, height, the corners of the next two gates, and the last action. Every number is divided
by a fixed unit that brings it to the order of one, see UNITS.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from quadsim.course import Course, Gate
from quadsim.course.opening import half_sizes
from quadsim.dynamics.named_tuples import field_types, flat, flat_names, unflat
from quadsim.dynamics.quadrotor import CONTROL, Control, State
from quadsim.rotation import along, body_axes

SPEED = 10.0  # unit of velocities [m/s]
RATE = 10.0  # unit of body rates [rad/s]
LENGTH = 10.0  # unit of lengths [m]
AFTER_LAST = 5.0  # distance from an open course's last gate to a virtual gate behind it [m]


class Vector(NamedTuple):
    """A vector in the world frame or in the body frame."""

    x: float
    y: float
    z: float


class GateNumbers(NamedTuple):
    """The position and the size of a gate's opening, as vectors in the world frame [m]."""

    centre: Vector
    left: Vector  # from the centre to the middle of the left edge
    up: Vector  # from the centre to the middle of the upper edge


class NextGates(NamedTuple):
    """The next two gates."""

    next: GateNumbers
    second: GateNumbers


class GateCorners(NamedTuple):
    """The corners of a gate's opening relative to the vehicle, in the body frame."""

    lower_right: Vector
    upper_right: Vector
    lower_left: Vector
    upper_left: Vector


class Observation(NamedTuple):
    """The observation of a pilot, in units that bring each number to the order of one."""

    velocity: Vector
    gravity: Vector  # direction of gravity
    rate: Vector
    height: float
    next_gate: GateCorners
    second_gate: GateCorners
    last: Control  # the last action, each in -1..1


FIELD_UNITS = {
    "velocity": f"{SPEED:g} m/s",
    "gravity": "1",
    "rate": f"{RATE:g} rad/s",
    "height": f"{LENGTH:g} m",
    "next_gate": f"{LENGTH:g} m",
    "second_gate": f"{LENGTH:g} m",
}


def _units() -> dict[str, str]:
    """Return the unit of each observed number by its name, in the order of Observation."""
    types = field_types(Observation)
    found: dict[str, str] = {}
    for field, unit in FIELD_UNITS.items():
        alone = NamedTuple(field, [(field, types[field])])
        for name in flat_names(alone, between=" "):
            found[name.replace("_", " ")] = unit
    return found | {f"last {name}": "1" for name in CONTROL}


UNITS = _units()
SIZE = len(UNITS)
GATE_NUMBERS = len(tuple(flat_names(GateNumbers)))


def corners(p, axes, gate):
    """Return the GateCorners of a gate's opening relative to a vehicle.

    Args:
        p: position of the vehicle [m].
        axes: body axes, the frame of the corners.
        gate: GateNumbers.

    Returns:
        GateCorners, in units of LENGTH.
    """
    dx = gate.centre.x - p[0]
    dy = gate.centre.y - p[1]
    dz = gate.centre.z - p[2]
    centre = Vector(*along(axes, dx / LENGTH, dy / LENGTH, dz / LENGTH))
    left = Vector(*along(axes, gate.left.x / LENGTH, gate.left.y / LENGTH, gate.left.z / LENGTH))
    up = Vector(*along(axes, gate.up.x / LENGTH, gate.up.y / LENGTH, gate.up.z / LENGTH))
    low = Vector(centre.x - up.x, centre.y - up.y, centre.z - up.z)
    high = Vector(centre.x + up.x, centre.y + up.y, centre.z + up.z)
    return GateCorners(
        lower_right=Vector(low.x - left.x, low.y - left.y, low.z - left.z),
        upper_right=Vector(high.x - left.x, high.y - left.y, high.z - left.z),
        lower_left=Vector(low.x + left.x, low.y + left.y, low.z + left.z),
        upper_left=Vector(high.x + left.x, high.y + left.y, high.z + left.z),
    )


def observation(x, gates, last):
    """Return the Observation of a vehicle.

    Args:
        x: State of the vehicle.
        gates: NextGates.
        last: the last action, a Control in -1..1.
    """
    axes = body_axes(x.attitude)
    _, _, x_up, _, _, y_up, _, _, z_up = axes  # world z component of each body axis
    return Observation(
        velocity=Vector(*along(axes, x.vx / SPEED, x.vy / SPEED, x.vz / SPEED)),
        gravity=Vector(-x_up, -y_up, -z_up),
        rate=Vector(x.wx / RATE, x.wy / RATE, x.wz / RATE),
        height=x.pz / LENGTH,
        next_gate=corners(x.position, axes, gates.next),
        second_gate=corners(x.position, axes, gates.second),
        last=last,
    )


def observe(
    x: Sequence[float] | np.ndarray,
    gates: Sequence[float] | np.ndarray,
    last: Sequence[float] | np.ndarray,
) -> np.ndarray:
    """Return a pilot's observation as an array, as the learning environments do.

    Args:
        x: state of the quadrotor: position [m], velocity [m/s], attitude (a unit quaternion wxyz),
            body rates [rad/s] and so on, as in an Estimate  (n_x,).
        gates: the row of `gate_rows` for the number of gates passed  (18,).
        last: the last action, four numbers in -1..1  (4,).

    Returns:
        The observation  (38,) float32; docs/learning.md lists its numbers with their units.

    Examples:
        >>> import quadsim
        >>> class Watching:
        ...     def control(self, x):
        ...         self.seen = quadsim.observe(x, ROWS[0], last=(0.0, 0.0, 0.0, 0.0))
        ...         return 0.0, 0.0, 0.0, 9.81
        >>> ROWS = quadsim.gate_rows(quadsim.load_course("figure8"), laps=1)
        >>> law = Watching()
        >>> run = quadsim.fly("figure8", controller=law, timeout=0.1)
        >>> law.seen.shape
        (38,)
    """
    seen = observation(State._make(x), unflat(NextGates, iter(gates)), Control._make(last))
    return np.array(list(flat(seen)), np.float32)


def gate_rows(course: Course, laps: int) -> np.ndarray:
    """Return the next two gates for each number of gates passed.

    Args:
        course: the course.
        laps: number of laps of the race.

    Returns:
        A row for each number of passed gates  (laps * gates + 1, 18). For the next gate and for
        the gate after it, in the world frame [m]: the centre of the opening, and the vectors
        from there to the middle of the left edge and of the upper edge.

    Examples:
        >>> import quadsim
        >>> quadsim.gate_rows(quadsim.load_course("figure8"), laps=1).shape
        (9, 18)
    """
    gates = [gate_numbers(gate) for gate in course.gates]
    if course.loop:
        after = [gates[0], gates[1 % len(gates)]]
    else:
        # behind the last gate of an open course, two virtual gates lie on its passage
        last = np.array(gates[-1])
        passage = course.gates[-1].rotation[:, 0]
        after = [last + np.concatenate([k * AFTER_LAST * passage, np.zeros(6)]) for k in (1, 2)]
    rows = np.array([*gates * laps, *after])
    return np.hstack([rows[:-1], rows[1:]])


def gate_numbers(gate: Gate) -> tuple[float, ...]:
    """Return the GateNumbers of a gate as an array, world frame [m].  (9,)"""
    half = half_sizes(gate.opening)
    left = half.left * gate.rotation[:, 1]
    up = half.up * gate.rotation[:, 2]
    return (*gate.position, *left.tolist(), *up.tolist())


def normalised(
    u: Sequence[float] | np.ndarray, low: Sequence[float], high: Sequence[float]
) -> np.ndarray:
    """Return a command within its limits as an action in -1..1.  (4,)"""
    lower = np.asarray(low)
    upper = np.asarray(high)
    return 2 * (np.asarray(u) - lower) / (upper - lower) - 1


def command(
    action: Sequence[float] | np.ndarray, low: Sequence[float], high: Sequence[float]
) -> np.ndarray:
    """Return an action in -1..1 as a command: body rates [rad/s] and thrust [m/s^2].  (4,)"""
    lower = np.asarray(low)
    upper = np.asarray(high)
    return lower + (np.clip(action, -1, 1) + 1) / 2 * (upper - lower)
