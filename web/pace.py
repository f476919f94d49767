"""Pace: when race time is due on the wall clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

LATE = 0.1  # [s] behind the wall clock, after which the race no longer tries to catch up
WINDOW = 1.0  # [s] over which the real-time factor is measured


class Mark(NamedTuple):
    """A moment at which the race had come to t."""

    wall: float  # [s]
    t: float  # [s]


class Pace:
    """Race time t is due at `speed` race seconds a second.

    Args:
        clock: returns the wall clock [s].
    """

    def __init__(self, clock: Callable[[], float] = perf_counter):
        self.speed = 1.0
        self._clock = clock
        self._marks: deque[Mark] = deque()
        self.anchor(0.0)

    def anchor(self, t: float) -> None:
        """Let the race time be t now."""
        self._anchored = Mark(self._clock(), t)
        self._marks.clear()

    def now(self) -> float:
        """Return the race time that is due [s]."""
        return self._anchored.t + (self._clock() - self._anchored.wall) * self.speed

    def until(self, t: float) -> float:
        """Return the wall-clock time until t is due; at most 0 if it is [s].

        A long delay is not caught up with later.
        """
        wait = (t - self.now()) / self.speed
        if wait < -LATE:
            self._anchored = Mark(self._clock(), t)
        return wait

    def mark(self, t: float) -> None:
        """Note that the race has come to t."""
        wall = self._clock()
        self._marks.append(Mark(wall, t))
        while len(self._marks) > 2 and wall - self._marks[0].wall > WINDOW:
            self._marks.popleft()

    @property
    def factor(self) -> float:
        """The race seconds a second of late; 0 while nothing moves."""
        if len(self._marks) < 2:
            return 0.0
        first, last = self._marks[0], self._marks[-1]
        return (last.t - first.t) / max(last.wall - first.wall, 1e-9)
