"""A cost term for races: the clearance to another vehicle.

    a_k keep max(0, 1 - d^2 / keep^2),   d^2 = dx^2 + dy^2 + (h dz)^2

The predicted position of the other vehicle depends on the step of the horizon, so it is an array of
parameters. h is smaller than 1, so that the room around a vehicle is an ellipsoid taller than wide.
Below the other vehicle h is `below`, as its downwash reaches far down; above it, h is `above`.
Crazyswarm uses such ellipsoids, of 0.12 x 0.12 x 0.30 m (Preiss et al., ICRA 2017).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import maximum, where

from controllers.costs import Term

# [m] Position of a vehicle that has left the race, out of reach of all samples
NOWHERE = 1e4


class Room(NamedTuple):
    """The ellipsoid around another vehicle that is kept clear."""

    # cost per metre inside the ellipsoid; half of it at the ellipsoid's edge
    weight: float
    # horizontal half axis of the ellipsoid [m]
    keep: float
    # ratio of keep to the vertical half axis, above and below the other vehicle
    above: float
    below: float


def keep_clear(x, x_next, u, gate, p):
    """Return the depth of the sample in the room around another vehicle [m]."""
    dx = x_next.px - p.x
    dy = x_next.py - p.y
    dz = x_next.pz - p.z
    height = dz * where(dz < 0.0, p.below, p.above)
    square = dx * dx + dy * dy + height * height
    return p.keep * maximum(1.0 - square * p.per_square, 0.0)


class OtherVehicle:
    """The term that keeps clear of the predicted path of one other vehicle."""

    def __init__(self, number: int, room: Room, horizon: int):
        """Begin without a prediction of the vehicle.

        Args:
            number: number of the vehicle, for the term's name.
            room: the room around the vehicle.
            horizon: T.
        """
        self._room = room
        self._x = np.full(horizon, NOWHERE)
        self._y = np.full(horizon, NOWHERE)
        self._z = np.full(horizon, NOWHERE)
        # One weight and one distance per step, as they may change from plan to plan.
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
        """Set the predicted positions of the vehicle for the next plans.

        Args:
            positions: position at the end of each step of the horizon [m]  (T, 3).
            share: factor on the weight.
            keep_share: factor on the clearance.
        """
        # The term shares these arrays, and they are read again for each plan.
        self._x[:] = positions[:, 0]
        self._y[:] = positions[:, 1]
        self._z[:] = positions[:, 2]
        self._weight[:] = share * self._room.weight
        keep = keep_share * self._room.keep
        self._keep[:] = keep
        self._per_square[:] = 1.0 / keep**2

    def expect_nowhere(self) -> None:
        """Remove the prediction, as the vehicle has left the race."""
        self._x[:] = NOWHERE
