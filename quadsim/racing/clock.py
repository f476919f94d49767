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
            t: when its planning started [s].
            spent: how long it took on the wall clock [s]; 0 for the first plan of a flight, which
                may include compiling.
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
    """A clock on which planning takes as long as it takes on the wall clock, and nothing else does.

    The vehicles of a race are planned one after the other, though each has a computer of its own;
    the page pauses flights and flies them in slow motion. On this clock a vehicle pays for its own
    planning time alone.
    """

    def ready(self, t: float, spent: float) -> float:
        """Return the time at which a plan is ready [s]."""
        return t + spent


CLOCKS: dict[str, type[Clock]] = {"simulated": Clock, "wall": WallClock}
