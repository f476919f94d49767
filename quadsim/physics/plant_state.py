"""The state after a physics step, and the state in which a flight starts."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

from quadsim.course import Start
from quadsim.physics.allocation import Vector
from quadsim.vehicle import GRAVITY

CLEARANCE = 1e-3  # between the ground and a vehicle that starts on it [m]


@dataclass(frozen=True, slots=True)
class PlantState:
    """The state after a physics step."""

    t: float  # [s]
    x: Vector  # STATE
    contacts: tuple[str, ...]  # what the vehicle touches: "ground", "gate 3", "obstacle 2"

    @property
    def position(self) -> tuple[float, float, float]:
        """Of a state that begins with one [m]; a state of fewer than three numbers is filled up with zeros."""
        x, y, z = (*self.x[:3], 0.0, 0.0)[:3]
        return x, y, z


def start_state(start: Start, radius: float) -> Vector:
    """At rest, level, hover thrust; lifted clear of the ground where the start stands on it.  (17,)"""
    x, y, z = start.position
    half = 0.5 * start.yaw
    p = (x, y, max(z, radius + CLEARANCE))
    return (*p, 0.0, 0.0, 0.0, cos(half), 0.0, 0.0, sin(half), 0.0, 0.0, 0.0, GRAVITY, 0.0, 0.0, 0.0)
