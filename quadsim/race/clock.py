"""Clocks: whether simulated time passes while the controller plans."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter, sleep


class Clock:
    """Simulated clock: planning takes no simulated time, so that every flight is reproducible to
    the last bit.

    Time t [s] counts from the start of the flight.
    """

    def now(self, t: float) -> float:
        """The simulated time now, when the planning that started at t has ended [s]."""
        return t

    def wait(self, t: float) -> None:
        """Return when the time is t [s]."""


class WallClock(Clock):
    """Real-time clock: simulated time runs on while the controller plans."""

    def __init__(
        self, time: Callable[[], float] = perf_counter, sleep: Callable[[float], None] = sleep
    ):
        """time: a clock [s] of any origin. sleep: waits for a number of seconds."""
        self._time, self._sleep = time, sleep
        self._began: float | None = None

    def now(self, t: float) -> float:
        # time starts when the first plan is ready, as that one may include compiling
        if self._began is None:
            self._began = self._time() - t
        return self._time() - self._began

    def wait(self, t: float) -> None:
        self._sleep(max(t - self.now(t), 0.0))


CLOCKS = {"simulated": Clock, "wall": WallClock}
