"""The time since the simulator's start, beside the wall clock."""

from __future__ import annotations

from time import perf_counter

# [s] A flight that lags further behind the wall clock is slower than it from then on.
LAG = 0.25


class SimulatorClock:
    """Counts the time since the simulator's start, which a flight may hold up.

    Attributes:
        boot: time since the simulator's start [s].
        lost: time by which the flights were slower than the wall clock [s].
    """

    def __init__(self) -> None:
        self.boot = 0.0
        self.lost = 0.0
        # reading of the wall clock at boot = 0, moved by all the time in which `boot` stood still
        self._origin = perf_counter()

    def go_on(self) -> None:
        """Let the time go on from its present value."""
        self._origin = perf_counter() - self.boot

    def follow_wall(self) -> None:
        """Set the time by the wall clock."""
        self.boot = perf_counter() - self._origin

    def behind(self) -> float:
        """Return by how much the time is behind the wall clock [s]."""
        return perf_counter() - self._origin - self.boot

    def wall(self, boot: float) -> float:
        """Return the reading of the wall clock [s] at a time since the simulator's start [s]."""
        return self._origin + boot

    def note_lag(self, boot: float) -> None:
        """Make up for a flight that is far behind the wall clock.

        Args:
            boot: the time that the flight has reached [s].
        """
        late = perf_counter() - self.wall(boot)
        if late > LAG:
            self.lost += late
            self._origin += late
