"""Pace: the relation of race time to the wall clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import perf_counter
from typing import NamedTuple

LATE = 0.1  # delay behind the wall clock beyond which the race does not catch up [s]
WINDOW = 1.0  # [s] over which the real-time factor is measured


class Mark(NamedTuple):
    """A moment at which the race had reached t."""

    wall: float  # [s]
    t: float  # [s]


class Pace:
    """A clock of race time that runs at `speed` race seconds per second.

    Args:
        clock: returns the wall clock [s].
    """

    def __init__(self, clock: Callable[[], float] = perf_counter):
        self.speed = 1.0
        self._clock = clock
        self._marks: deque[Mark] = deque()
        self.anchor(0.0)

    def anchor(self, t: float) -> None:
        """Set the present race time to t."""
        self._anchored = Mark(self._clock(), t)
        self._marks.clear()

    def now(self) -> float:
        """Return the race time that is due [s]."""
        return self._anchored.t + (self._clock() - self._anchored.wall) * self.speed

    def until(self, t: float) -> float:
        """Return the wall-clock time until t is due; at most 0 if it is [s].

        A delay of more than LATE is dropped.
        """
        wait = (t - self.now()) / self.speed
        if wait < -LATE:
            self._anchored = Mark(self._clock(), t)
        return wait

    def mark(self, t: float) -> None:
        """Note that the race has reached t."""
        wall = self._clock()
        self._marks.append(Mark(wall, t))
        while len(self._marks) > 2 and wall - self._marks[0].wall > WINDOW:
            self._marks.popleft()

    @property
    def factor(self) -> float:
        """The recent race seconds per second; 0 while nothing moves."""
        if len(self._marks) < 2:
            return 0.0
        first, last = self._marks[0], self._marks[-1]
        return (last.t - first.t) / max(last.wall - first.wall, 1e-9)
