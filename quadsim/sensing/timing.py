"""The instants at which a sensor samples, at its own rate."""

from __future__ import annotations

from math import floor, isclose


class Ticks:
    """The instants k / rate; each is due at the first physics step at or after it.

    A sample carries the time of the physics step at which it was taken.
    """

    def __init__(self, rate: float):
        """Begin at t = 0, with a sampling rate [Hz]."""
        self._rate = rate
        self._done: int | None = None

    def due(self, t: float) -> bool:
        """Return whether an instant has come since the last call that returned True.

        Args:
            t: time [s], which must not decrease from call to call.
        """
        ticks = t * self._rate
        now = round(ticks) if isclose(ticks, round(ticks), abs_tol=1e-6) else floor(ticks)
        if self._done is not None and now <= self._done:
            return False
        self._done = now
        return True
