"""ExpectedPath: a path that another vehicle is expected to fly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


@dataclass(frozen=True, eq=False)
class ExpectedPath:
    """A path that a vehicle is expected to fly.

    It keeps a copy of the positions that cannot be written to. The path goes on straight beyond its
    ends; a path that ends at a place has this place as its last two positions.

    Examples:
        >>> import numpy as np
        >>> from quadsim.dynamics.expected_path import ExpectedPath
        >>> path = ExpectedPath(t0=0.0, dt=0.5, positions=np.array([[0, 0, 2], [5, 0, 2]]))
        >>> path.at(np.array([0.25, 1.0])).tolist()
        [[2.5, 0.0, 2.0], [10.0, 0.0, 2.0]]
    """

    # time of the first position [s]
    t0: float
    # time from one position to the next [s]
    dt: float
    # [m]  (n, 3), at least two
    positions: np.ndarray

    def __post_init__(self) -> None:
        positions = np.array(self.positions, float)
        positions.setflags(write=False)
        object.__setattr__(self, "positions", positions)

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the positions at some times [m]  (len(times), 3).

        Between positions the path is a straight line, which goes on beyond the first and the last.

        Args:
            times: [s].
        """
        k = (times - self.t0) / self.dt
        # Conversion to int rounds down, as none of these is negative.
        first = np.minimum(np.maximum(k, 0.0), len(self.positions) - 2).astype(int)
        start = self.positions[first]
        share = (k - first)[:, None]
        return start + share * (self.positions[first + 1] - start)


class OtherVehicle(NamedTuple):
    """Another vehicle of a race, as it is known."""

    # its index in the race, from 0
    number: int
    path: ExpectedPath
