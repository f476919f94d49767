"""Clocks: whether simulated time passes while the controller plans."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter, sleep


class Clock:
    """Simulated clock: planning takes no simulated time.

    With this clock, flights are reproducible to the last bit. Time t [s] counts from the start of
    the flight.
    """

    def ready(self, t: float, spent: float) -> float:
        """Return the time at which a plan is ready [s].

        Args:
            t: time at which planning started [s].
            spent: duration of planning on the wall clock [s]; 0 for the first plan of a flight,
                which may include compiling.
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

    def ready(self, t: float, spent: float) -> float:
        """Return the time that has passed since the first plan was ready [s].

        The first plan takes no time, as it may include compiling.
        """
        if self._began is None:
            self._began = self._time() - t
        return self._time() - self._began

    def wait(self, t: float) -> None:
        """Wait until the time is t [s]."""
        self._sleep(max(t - self.ready(t, 0.0), 0.0))


class PlanningClock(Clock):
    """A clock on which only planning takes time, namely its duration on the wall clock.

    In a race this computer plans for one vehicle after the other, although each vehicle would have
    its own computer, and the page pauses flights or shows them in slow motion. With this clock a
    vehicle is delayed by its own planning only.
    """

    def ready(self, t: float, spent: float) -> float:
        """Return the time at which a plan is ready [s]."""
        return t + spent


CLOCKS: dict[str, type[Clock]] = {"simulated": Clock, "wall": WallClock}
