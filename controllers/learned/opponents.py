"""The observations of other racers, as plain functions over scalars.

Position and velocity of an opponent are given relative to the observing vehicle, in its body frame
(x forward, y left, z up). The nearest opponent comes first, because it is the most important to
avoid.
"""

from __future__ import annotations

from typing import NamedTuple

from quadsim.controllers.learned.observation import LENGTH, SPEED, Vector
from quadsim.dynamics.named_tuples import flat_names
from quadsim.rotation import along, body_axes


class Away(NamedTuple):
    """The relative position and velocity of another vehicle, world frame."""

    position: Vector  # [m]
    velocity: Vector  # [m/s]


class Opponent(NamedTuple):
    """The observation of one opponent."""

    here: float  # 1 while the opponent is in the race; else 0, like all other numbers
    position: Vector  # relative, in the vehicle's frame, in LENGTH
    velocity: Vector  # relative, in the vehicle's frame, in SPEED


OPPONENT_UNITS = {
    "here": "1",
    **dict.fromkeys(("position x", "position y", "position z"), f"{LENGTH:g} m"),
    **dict.fromkeys(("velocity x", "velocity y", "velocity z"), f"{SPEED:g} m/s"),
}
OPPONENT_SIZE = len(tuple(flat_names(Opponent)))


def seen_opponent(x, away):
    """Return the Opponent that a vehicle observes.

    Args:
        x: State of the observing vehicle.
        away: Away of an opponent that is in the race.
    """
    axes = body_axes(x.attitude)
    p = away.position
    v = away.velocity
    return Opponent(
        here=1.0,
        position=Vector(*along(axes, p.x / LENGTH, p.y / LENGTH, p.z / LENGTH)),
        velocity=Vector(*along(axes, v.x / SPEED, v.y / SPEED, v.z / SPEED)),
    )
