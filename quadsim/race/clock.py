"""Clocks: whether simulated time passes while a plan is made."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter, sleep


class Clock:
    """Relates simulated time t, which counts from the start of the flight [s], to the time that planning takes.

    Here a plan takes no simulated time: every flight is reproducible to the last bit.
    """

    def now(self, t: float) -> float:
        """The simulated time at which a plan that was begun at t is ready."""
        return t

    def wait(self, t: float) -> None:
        """Return when it is t."""


class WallClock(Clock):
    """Simulated seconds are real ones: a plan acts once it is ready."""

    def __init__(self, time: Callable[[], float] = perf_counter, sleep: Callable[[float], None] = sleep):
        """time: [s] from any instant on. sleep: passes so many seconds of it."""
        self._time, self._sleep = time, sleep
        self._began: float | None = None

    def now(self, t: float) -> float:
        if self._began is None:  # the flight begins when the first plan is ready, which may have had to compile
            self._began = self._time() - t
        return self._time() - self._began

    def wait(self, t: float) -> None:
        self._sleep(max(t - self.now(t), 0.0))


CLOCKS = {"simulated": Clock, "wall": WallClock}
