"""What the referee asks of gates: does the vehicle fit, how far is the way, are two crossed at
once."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, dist, hypot, radians

from quadsim.course import Course, Gate
from quadsim.course.opening import approach_length
from quadsim.course.swept import SweptGate
from quadsim.rotation import Vec3

# [m] between sphere and ground; only after that is the ground a crash, as a flight may start on it
TAKE_OFF = 0.1
# gates closer than this [m, cos] are crossed at once
SAME_PLACE, SAME_WAY = 0.1, cos(radians(45.0))


def check(course: Course, laps: int, gates: Sequence[SweptGate], radius: float) -> None:
    """Raises ValueError for laps that the course does not have and for a gate that the vehicle
    cannot pass."""
    most = laps if course.loop else 1
    if not 1 <= laps <= most:
        wanted = "at least 1 lap" if course.loop else "1 lap, as the course is open"
        raise ValueError(f"{course.name}: expected {wanted}, got {laps}")
    for swept in gates:
        where, free = f"{course.name}: gates[{swept.index}]", swept.free
        if min(free) <= 0.0:
            width, height = swept.gate.opening
            wider = f"expected an opening wider than the vehicle's {2 * radius:g} m"
            raise ValueError(f"{where}: {wider}, got {width:g} x {height:g} m")
        _, left, up = swept.gate.axes
        highest = swept.gate.position[2] + abs(left[2]) * free.left + abs(up[2]) * free.up
        if highest < radius + TAKE_OFF:
            above = f"expected an opening that is free {radius + TAKE_OFF:g} m above the ground, for the vehicle"
            raise ValueError(f"{where}: {above}, got {highest:.2f} m")


def way_left(gate: Gate, p: Vec3) -> float:
    """Return the way from p to the gate's centre, from behind the gate by the point where its
    approach begins [m]."""
    here = gate.to_local(p)
    if here.along <= 0.0:
        return hypot(*here)
    approach = approach_length(gate.opening)
    return hypot(here.along + approach, here.left, here.up) + approach


def crossed_at_once(gate: Gate, following: Gate) -> bool:
    """Whether one crossing leads through both: they stand in one place and face alike."""
    alike = sum(a * b for a, b in zip(gate.axes[0], following.axes[0], strict=True)) > SAME_WAY
    return alike and dist(gate.position, following.position) < SAME_PLACE
