"""Race time against the wall clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import perf_counter

LATE = 0.1  # [s] behind the wall clock, after which the race no longer tries to catch up
WINDOW = 1.0  # [s] over which the real-time factor is measured


class Pace:
    """When race time t is due at `speed` race seconds a second."""

    def __init__(self, clock: Callable[[], float] = perf_counter):
        self._clock = clock
        self.speed = 1.0
        self._marks: deque[tuple[float, float]] = deque()
        self.anchor(0.0)

    def anchor(self, t: float) -> None:
        """The race time is t now."""
        self._t, self._wall = t, self._clock()
        self._marks.clear()

    def now(self) -> float:
        """[s] of race time."""
        return self._t + (self._clock() - self._wall) * self.speed

    def until(self, t: float) -> float:
        """Seconds of wall clock until t is due; at most 0 if it is. A long delay is not caught up later."""
        wait = (t - self.now()) / self.speed
        if wait < -LATE:
            self._t, self._wall = t, self._clock()
        return wait

    def mark(self, t: float) -> None:
        """t has been flown."""
        wall = self._clock()
        self._marks.append((wall, t))
        while len(self._marks) > 2 and wall - self._marks[0][0] > WINDOW:
            self._marks.popleft()

    @property
    def factor(self) -> float:
        """Race seconds a second, lately; 0 while nothing moves."""
        if len(self._marks) < 2:
            return 0.0
        (w0, t0), (w1, t1) = self._marks[0], self._marks[-1]
        return (t1 - t0) / max(w1 - w0, 1e-9)
