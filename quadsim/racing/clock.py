"""Clocks: whether simulated time passes while the controller plans."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter, sleep


class Clock:
    """Simulated clock: planning takes no simulated time.

    With this clock, flights are reproducible to the last bit. Time t [s] counts from the start of
    the flight.
    """

    def now(self, t: float) -> float:
        """Return the time at which planning has ended [s].

        Args:
            t: time at which the planning started [s].
        """
        return t

    def wait(self, t: float) -> None:
        """Wait until the time is t [s]."""


class WallClock(Clock):
    """Real-time clock: simulated time runs on while the controller plans."""

    def __init__(
        self, time: Callable[[], float] = perf_counter, sleep: Callable[[float], None] = sleep
    ):
        """Make a clock from two functions.

        Args:
            time: function that returns the time from any origin [s].
            sleep: function that waits for a number of seconds.
        """
        self._time = time
        self._sleep = sleep
        self._began: float | None = None

    def now(self, t: float) -> float:
        """Return the time since the first plan was ready [s].

        The first plan takes no time, as it may include compiling.
        """
        if self._began is None:
            self._began = self._time() - t
        return self._time() - self._began

    def wait(self, t: float) -> None:
        """Wait until the time is t [s]."""
        self._sleep(max(t - self.now(t), 0.0))


CLOCKS: dict[str, type[Clock]] = {"simulated": Clock, "wall": WallClock}
