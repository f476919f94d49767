"""A cost term for races: the distance that is kept from another vehicle.

    a_k keep max(0, 1 - d^2 / keep^2),   d^2 = dx^2 + dy^2 + (h dz)^2

Where the other vehicle is expected depends on the step of the horizon, so its position is an array
of parameters. h is smaller than 1, so that the room around a vehicle is an ellipsoid taller than
wide. Below the vehicle h is `below`, as its downwash reaches far down; above it, h is `above`.
Crazyswarm uses such ellipsoids, of 0.12 x 0.12 x 0.30 m (Preiss et al., ICRA 2017).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import maximum, where

from controllers.costs import Term

# [m] Where a vehicle is expected that is not there: no sample comes near.
NOWHERE = 1e4


class Room(NamedTuple):
    """The room around another vehicle that is kept clear."""

    # weight of each metre that is missing, at the ellipsoid's edge half of that
    weight: float
    # half of the room's width [m]
    keep: float
    # keep over half of the room's height, above the other vehicle and below it
    above: float
    below: float


def keep_clear(x, x_next, u, gate, p):
    """Return how deep the sample is in the room around another vehicle [m]."""
    dx = x_next.px - p.x
    dy = x_next.py - p.y
    dz = x_next.pz - p.z
    height = dz * where(dz < 0.0, p.below, p.above)
    square = dx * dx + dy * dy + height * height
    return p.keep * maximum(1.0 - square * p.per_square, 0.0)


class OtherVehicle:
    """The term that keeps clear of one other vehicle, wherever that is expected."""

    def __init__(self, number: int, room: Room, horizon: int):
        """Begin with a vehicle that is nowhere.

        Args:
            number: tells the terms of several vehicles apart.
            room: the room around it.
            horizon: T.
        """
        self._room = room
        self._x = np.full(horizon, NOWHERE)
        self._y = np.full(horizon, NOWHERE)
        self._z = np.full(horizon, NOWHERE)
        # One weight and one distance for each step: they may be others in each plan.
        self._weight = np.full(horizon, float(room.weight))
        self._keep = np.full(horizon, float(room.keep))
        self._per_square = np.full(horizon, 1.0 / room.keep**2)
        self.term = Term(
            keep_clear,
            self._weight,
            name=f"clear_of_{number}",
            x=self._x,
            y=self._y,
            z=self._z,
            keep=self._keep,
            per_square=self._per_square,
            above=room.above,
            below=room.below,
        )

    def expect(self, positions: np.ndarray, share: float = 1.0, keep_share: float = 1.0) -> None:
        """Expect the vehicle at these places from the next plan on.

        Args:
            positions: position at the end of each step of the horizon [m]  (T, 3).
            share: factor on the weight.
            keep_share: factor on the distance that is kept.
        """
        # The arrays are those of the term, whose numbers are read anew for each plan.
        self._x[:] = positions[:, 0]
        self._y[:] = positions[:, 1]
        self._z[:] = positions[:, 2]
        self._weight[:] = share * self._room.weight
        keep = keep_share * self._room.keep
        self._keep[:] = keep
        self._per_square[:] = 1.0 / keep**2

    def expect_nowhere(self) -> None:
        """Expect the vehicle nowhere, as it has left the race."""
        self._x[:] = NOWHERE
