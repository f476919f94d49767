"""The wall clock of a flight on the page, on which only planning takes time.

The page pauses flights, flies some in slow motion, and plans several in turns. None of this counts
as planning time.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from controllers.plan import PlanStats
from quadsim.dynamics.estimate import Estimate
from quadsim.heat.aware_planner import PlanningClock
from quadsim.racing.flight import Controller


class TimedController:
    """A controller that passes the duration of each plan to the clock of its flight.

    The first plan takes no time, as it may include compiling.
    """

    def __init__(self, controller: Controller, clock: PlanningClock):
        self._controller = controller
        self._clock = clock
        self._is_first = True

    @property
    def rest(self) -> np.ndarray:
        """The controller's control at rest.  (n_u,)"""
        return self._controller.rest

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the controller's control and statistics of its plan."""
        began = perf_counter()
        answer = self._controller.control(estimate)
        if not self._is_first:
            self._clock.spent = perf_counter() - began
        self._is_first = False
        return answer
