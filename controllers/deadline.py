"""A deadline for plans: fewer samples after a late plan, more after one that was early."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np

from controllers.lanes.layout import LANES
from controllers.mppi import MPPI
from controllers.plan import PlanStats
from quadsim.dynamics.estimate import Estimate

ROOM = 0.8  # share of the deadline below which the samples may grow again
SHRINK = 0.8  # factor on the samples after a late plan
GROW = 1.05  # factor on the samples after an early plan


class Deadline:
    """An MPPI whose number of samples follows its planning time.

    The number lies between one block of lanes and the configuration's.
    """

    def __init__(self, mppi: MPPI, deadline_ms: float, time: Callable[[], float] = perf_counter):
        """Adapt the samples of a planner.

        Args:
            mppi: the planner.
            deadline_ms: the time for one plan [ms].
            time: returns seconds since any instant.
        """
        self.mppi = mppi
        self.deadline_ms = deadline_ms
        self._time = time
        self._warm = False  # the first plan may have to compile

    @property
    def rest(self) -> np.ndarray:
        """The planner's control at rest.  (n_u,)"""
        return self.mppi.rest

    def control(self, known: Estimate | np.ndarray) -> tuple[np.ndarray, PlanStats]:
        """Return the control to apply and statistics of the plan; see MPPI.control."""
        began = self._time()
        answer = self.mppi.control(known)
        if self._warm:
            plan_ms = 1e3 * (self._time() - began)
            self.mppi.samples = self.next_samples(plan_ms)
        self._warm = True
        return answer

    def next_samples(self, plan_ms: float) -> int:
        """Return the samples of the next plan, after one that took plan_ms [ms].

        They are whole blocks of lanes, so that a smaller budget is never slower than a larger one.
        """
        now = self.mppi.samples
        most = self.mppi.config.samples
        if plan_ms > self.deadline_ms:
            fewer = int(now * SHRINK) // LANES * LANES
            return max(fewer, min(LANES, most))
        if plan_ms < ROOM * self.deadline_ms:
            more = -(-int(now * GROW + 1) // LANES) * LANES
            return min(more, most)
        return now
