"""ControlPeriods: how many control periods pass from one call of a controller to the next."""

from __future__ import annotations


class ControlPeriods:
    """Counts whole control periods between the instants at which a controller is called.

    Calls may be late by a part of a period, as under the wall clock. The instants are rounded, not
    the differences, so that the counts of late calls add up to the time that has passed.
    """

    def __init__(self, dt: float):
        """Start before the first call.

        dt: control period [s].
        """
        self._dt = dt
        # time of the last call [s]
        self._last: float | None = None

    @property
    def next(self) -> float:
        """The time one period after the last call, 0 before the first call [s]."""
        return 0.0 if self._last is None else self._last + self._dt

    def advance(self, t: float) -> int:
        """Return the periods from the last call to one at t [s], which becomes the last one.

        Returns:
            0 at the first call and where no time has passed, else at least 1.
        """
        last = self._last
        self._last = t
        if last is None or t <= last:
            return 0
        return max(round(t / self._dt) - round(last / self._dt), 1)
