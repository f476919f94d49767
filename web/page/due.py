"""Limits on how often the page is updated, and parts of it are sent."""

from __future__ import annotations

from math import inf
from time import perf_counter


class Beat:
    """A clock that strikes at most once per period.

    Args:
        period: [s]
    """

    def __init__(self, period: float):
        self._period = period
        self._at = -inf

    def strikes(self) -> bool:
        """Return whether the period is over, and begin another one."""
        now = perf_counter()
        if now - self._at < self._period:
            return False
        self._at = now
        return True


class Due:
    """Decides whether a part of the page is sent again.

    Args:
        period: shortest time between two messages [s]
    """

    def __init__(self, period: float):
        self._beat = Beat(period)
        self._shown: object = None

    def __call__(self, what: object) -> bool:
        """Return whether to show `what`, which then counts as shown."""
        if what == self._shown or not self._beat.strikes():
            return False
        self._shown = what
        return True


class Calm:
    """Tells whether something has not changed for some time.

    Args:
        period: this time [s]
    """

    def __init__(self, period: float):
        self._period = period
        self._last: object = None
        self._since = inf  # when it last changed [s]

    def __call__(self, what: object) -> bool:
        """Return whether `what` has been equal at all calls of the last period."""
        now = perf_counter()
        if what != self._last:
            self._last = what
            self._since = now
        return now - self._since >= self._period
