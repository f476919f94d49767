"""What time does while a plan is made: the simulated world waits, or it does not."""

from __future__ import annotations

from time import perf_counter, sleep
from typing import Protocol


class Clock(Protocol):
    """What time does while a plan is made; t counts from the start of the flight [s]."""

    def now(self, t: float) -> float:
        """The time at which whatever began at t is done."""
        ...

    def wait(self, t: float) -> None:
        """Return when it is t."""
        ...


class SimulatedClock:
    """The world stands still while the controller thinks: every flight is reproducible to the last bit."""

    def now(self, t: float) -> float:
        return t

    def wait(self, t: float) -> None:
        pass


class WallClock:
    """The world does not wait: a plan acts when it is ready, and simulated seconds are real ones."""

    def __init__(self) -> None:
        self._began: float | None = None

    def now(self, t: float) -> float:
        if self._began is None:  # the first plan is made before the start signal; compiling is not racing
            self._began = perf_counter() - t
        return perf_counter() - self._began

    def wait(self, t: float) -> None:
        sleep(max(t - self.now(t), 0.0))


CLOCKS = {"simulated": SimulatedClock, "wall": WallClock}
