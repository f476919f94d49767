"""Reduce the clearance from a vehicle that has been followed for a while."""

from __future__ import annotations

# Share of the distance that is kept when all patience is lost
LEAST_SHARE = 0.5


class Patience:
    """The factor of the clearance from each vehicle, which depends on the time spent behind it.

    It falls from 1 to 0.5 within `seconds` behind a vehicle, and rises at the same rate when that
    vehicle has been passed or is far ahead.

    Examples:
        >>> from quadsim.heat.patience import Patience
        >>> patience = Patience(2.0)
        >>> [patience.share(3, 0.5 * k, follows=True) for k in range(6)]
        [1.0, 0.875, 0.75, 0.625, 0.5, 0.5]
    """

    def __init__(self, seconds: float):
        """Begin with the full clearance.

        Args:
            seconds: time behind a vehicle after which the clearance is halved [s].
        """
        self._seconds = seconds
        # number -> time lost behind that vehicle, at most `seconds` [s]
        self._lost: dict[int, float] = {}
        # number -> time of the last call for that vehicle [s]
        self._looked: dict[int, float] = {}

    def share(self, m: int, t: float, follows: bool) -> float:
        """Return the factor of the clearance from vehicle m.

        Args:
            m: number of the vehicle.
            t: present time [s].
            follows: whether that vehicle is closely ahead.
        """
        passed = t - self._looked.get(m, t)
        lost = self._lost.get(m, 0.0) + (passed if follows else -passed)
        self._looked[m] = t
        self._lost[m] = min(max(lost, 0.0), self._seconds)
        return 1.0 - (1.0 - LEAST_SHARE) * self._lost[m] / self._seconds
