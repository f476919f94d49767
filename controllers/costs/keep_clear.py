"""A cost term for races: the clearance to another vehicle.

    a_k keep max(0, 1 - d^2 / keep^2),   d^2 = dx^2 + dy^2 + (h dz)^2

The expected position of the other vehicle depends on the step of the horizon, so it is an array of
parameters. It comes with the estimate of each plan.

h is smaller than 1, so that the room around a vehicle is an ellipsoid taller than wide. Below the
vehicle h is `below`, as its downwash reaches far down; above it, h is `above`.
Crazyswarm uses such ellipsoids, of 0.12 x 0.12 x 0.30 m (Preiss et al., ICRA 2017).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy import maximum, where

from quadsim.controllers.costs import EstimatedTerm, Weight

if TYPE_CHECKING:
    from quadsim.dynamics.estimate import Estimate

# Coordinates of a vehicle that is not there [m]
NOWHERE = 1e4


class Clearance(NamedTuple):
    """The room around another vehicle that is kept clear."""

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


class KeepClear(EstimatedTerm):
    """The term that keeps clear of one other vehicle, by the path that an estimate has of it.

    Examples:
        >>> from quadsim.controllers.costs.keep_clear import Clearance, KeepClear
        >>> clearance = Clearance(weight=200.0, keep=0.6, above=0.8, below=0.4)
        >>> term = KeepClear(vehicle=3, name="clear_of_1", clearance=clearance, horizon=150)
        >>> term.scaled(weight_share=0.5)["weight"]
        100.0
    """

    def __init__(self, vehicle: int, name: str, clearance: Clearance, horizon: int):
        """Begin with a vehicle that is nowhere.

        Args:
            vehicle: number of the other vehicle in its race.
            name: name of the term. Planners whose terms have the same names share compiled loops.
            clearance: the room around the vehicle that is kept clear.
            horizon: T.
        """
        self.vehicle = vehicle
        self.clearance = clearance
        self._horizon = horizon
        scaled = self.scaled()
        super().__init__(
            keep_clear,
            scaled["weight"],
            name,
            **self._nowhere(),
            keep=scaled["keep"],
            per_square=scaled["per_square"],
            above=clearance.above,
            below=clearance.below,
        )

    def __reduce__(self) -> tuple:
        return KeepClear, (self.vehicle, self.name, self.clearance, self._horizon)

    def numbers_from(self, estimate: Estimate, times: np.ndarray) -> dict[str, Weight]:
        """Return the predicted positions of the other vehicle at these times.

        A vehicle that has not started or has left is placed where no sample comes near.

        Args:
            estimate: what is known.
            times: at which the steps of the horizon end, in the time of the others' paths [s]
                (T,).

        Returns:
            The parameters x, y and z [m]  (T,) each.
        """
        for other in estimate.others:
            if other.number == self.vehicle:
                x, y, z = other.path.at(times).T
                return {"x": x, "y": y, "z": z}
        return self._nowhere()

    def scaled(self, weight_share: float = 1.0, keep_share: float = 1.0) -> dict[str, float]:
        """Return the weight, and the parameters keep and per_square.

        Args:
            weight_share: factor on the weight.
            keep_share: factor on the distance that is kept.
        """
        keep = keep_share * self.clearance.keep
        return {
            "weight": weight_share * self.clearance.weight,
            "keep": keep,
            "per_square": 1.0 / keep**2,
        }

    def _nowhere(self) -> dict[str, Weight]:
        """Return positions that no sample comes near [m]  (T,) each."""
        nowhere = np.full(self._horizon, NOWHERE)
        return {"x": nowhere, "y": nowhere, "z": nowhere}
