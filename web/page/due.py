"""Limits on how often parts of the page are sent: after a change, at most once per period."""

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
