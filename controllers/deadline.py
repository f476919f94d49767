"""A deadline for plans: fewer samples after a late plan, more samples after an early plan."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Protocol, cast

import numpy as np

from controllers.lanes.layout import LANES
from controllers.mppi import MPPI
from controllers.plan import PlanStats
from quadsim.dynamics.estimate import Estimate

ROOM = 0.8  # share of the deadline below which the samples may grow again
SHRINK = 0.8  # factor on the samples after a late plan
GROW = 1.05  # factor on the samples after an early plan


class Planning(Protocol):
    """A controller that plans with an MPPI."""

    @property
    def rest(self) -> np.ndarray:
        """The control at rest.  (n_u,)"""
        ...

    def control(self, known: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the control to apply and statistics of the plan."""
        ...


class Deadline:
    """A planner whose number of samples follows its planning time.

    The number lies between one block of lanes and the number in the configuration.
    """

    def __init__(
        self,
        controller: Planning,
        deadline_ms: float,
        time: Callable[[], float] = perf_counter,
        planner: Callable[[], MPPI] | None = None,
    ):
        """Adapt the samples of a planner.

        Args:
            controller: the planner, or a controller that plans with one.
            deadline_ms: the time for one plan [ms].
            time: function that returns the time since any instant [s].
            planner: function that returns the controller's present MPPI; None: the controller is
                the MPPI itself.
        """
        self._controller = controller
        self._planner = planner or (lambda: cast(MPPI, controller))
        self.deadline_ms = deadline_ms
        self._time = time
        self._warm = False  # the first plan may have to compile

    @property
    def rest(self) -> np.ndarray:
        """The planner's control at rest.  (n_u,)"""
        return self._controller.rest

    def control(self, known: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the control to apply and statistics of the plan; see MPPI.control."""
        began = self._time()
        answer = self._controller.control(known)
        if self._warm:
            plan_ms = 1e3 * (self._time() - began)
            self._planner().samples = self.next_samples(plan_ms)
        self._warm = True
        return answer

    def next_samples(self, plan_ms: float) -> int:
        """Return the number of samples of the next plan, after a plan of plan_ms [ms].

        The samples fill whole blocks of lanes, so that a smaller budget is never slower than a
        larger one.
        """
        mppi = self._planner()
        now = mppi.samples
        most = mppi.config.samples
        if plan_ms > self.deadline_ms:
            fewer = int(now * SHRINK) // LANES * LANES
            return max(fewer, min(LANES, most))
        if plan_ms < ROOM * self.deadline_ms:
            more = -(-int(now * GROW + 1) // LANES) * LANES
            return min(more, most)
        return now
