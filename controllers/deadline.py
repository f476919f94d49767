"""A deadline for plans: fewer samples after a plan that took too long, more after one that took
much less."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

from controllers.lanes.layout import LANES
from controllers.mppi import MPPI
from controllers.plan import PlanStats
from quadsim.dynamics.estimate import Estimate

ROOM = 0.8  # of the deadline; below it the samples may grow again
SHRINK, GROW = 0.8, 1.05


class Deadline:
    """An MPPI whose number of samples follows its planning time, between one block of lanes and its
    configuration's."""

    def __init__(self, mppi: MPPI, deadline_ms: float, time: Callable[[], float] = perf_counter):
        """deadline_ms: for one plan [ms]. time: [s] from any instant on."""
        self.mppi, self.deadline_ms, self._time = mppi, deadline_ms, time
        self._warm = False  # the first plan may have to compile

    @property
    def rest(self) -> np.ndarray:
        return self.mppi.rest

    def control(self, known: Estimate | np.ndarray) -> tuple[np.ndarray, PlanStats]:
        """Return the control to apply and statistics of the plan; see MPPI.control."""
        began = self._time()
        answer = self.mppi.control(known)
        if self._warm:
            self.mppi.samples = self.next_samples(1e3 * (self._time() - began))
        self._warm = True
        return answer

    def next_samples(self, plan_ms: float) -> int:
        """Whole blocks of lanes, so that a smaller budget is never slower than a larger one."""
        now, most = self.mppi.samples, self.mppi.config.samples
        if plan_ms > self.deadline_ms:
            return max(int(now * SHRINK) // LANES * LANES, min(LANES, most))
        if plan_ms < ROOM * self.deadline_ms:
            return min(-(-int(now * GROW + 1) // LANES) * LANES, most)
        return now
