"""The planner of one flight, with changes of its numbers and a deadline."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from time import perf_counter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from quadsim.controllers.costs import Weight
from quadsim.controllers.deadline import next_samples
from quadsim.controllers.plan import PlannerSnapshot, PlanStats
from quadsim.controllers.presets import Planner
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.expected_path import ExpectedPath

if TYPE_CHECKING:
    from quadsim.controllers.mppi import MPPI


class Change(NamedTuple):
    """A change of a planner's numbers at a time of its flight."""

    # time of the first plan with the new numbers [s]
    t: float
    # returns the new numbers, given the previous ones
    after: Callable[[Planner], Planner]


class PlannerInFlight:
    """A planner whose numbers may change between two plans, and whose samples follow a deadline.

    It is a controller, see quadsim.racing.flight.Controller.

    Attributes:
        planner: the MPPI that plans at present. A change replaces it.
    """

    def __init__(
        self,
        planner: MPPI,
        numbers: Planner,
        make: Callable[[Planner], MPPI],
        changes: Iterable[Change] = (),
        deadline_ms: float | None = None,
        time: Callable[[], float] = perf_counter,
    ):
        """Begin with the planner at the start of the flight.

        Args:
            planner: the planner.
            numbers: numbers of the planner.
            make: function that makes a planner of this flight with other numbers.
            changes: changes to make in flight, in the order of their times.
            deadline_ms: time allowed for one plan [ms], which decides the number of samples; None:
                there is no deadline.
            time: function that returns the time since a fixed instant [s].
        """
        self.planner = planner
        self._numbers = numbers
        self._make = make
        self._coming = iter(changes)
        self._next = next(self._coming, None)
        self._deadline_ms = deadline_ms
        self._time = time
        self._is_first = True

    @property
    def rest(self) -> np.ndarray:
        """The control at rest, which is applied until the first plan is ready.  (n_u,)"""
        return self.planner.rest

    @property
    def is_cached(self) -> bool:
        """Whether the loops of the present planner were compiled on this machine before."""
        return self.planner.is_cached

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Make the changes that are due, and return the control and statistics of the plan."""
        began = self._time()
        self._make_changes(estimate.t)
        answer = self.planner.control(estimate)
        # The first plan may have to compile.
        if self._deadline_ms and not self._is_first:
            plan_ms = 1e3 * (self._time() - began)
            mppi = self.planner
            most = mppi.config.samples
            mppi.samples = next_samples(mppi.samples, most, plan_ms, self._deadline_ms)
        self._is_first = False
        return answer

    def set_numbers(self, term: str, **numbers: Weight) -> None:
        """Use other numbers of one cost term from the next plan on; see MPPI.set_numbers."""
        self.planner.set_numbers(term, **numbers)

    def change(self, numbers: Planner) -> None:
        """Use other numbers from the next plan on, which starts from the last plan."""
        planner = self._make(numbers)
        planner.continue_from(self.planner)
        # If the new numbers have the same temperature, keep the one adapted to the target ESS.
        if numbers.mppi.temperature == self._numbers.mppi.temperature:
            planner.temperature = self.planner.temperature
        self.planner = planner
        self._numbers = numbers

    def planned_path(self, estimate: Estimate) -> ExpectedPath:
        """Return the path of the present plan, in the time of the race.

        Args:
            estimate: the estimate from which it was planned.
        """
        # here: it loads the compiler
        from quadsim.controllers.sampled_trajectories import planned_path

        return planned_path(self.planner, estimate)

    def snapshot(self) -> PlannerSnapshot | None:
        """Return the snapshot of the last plan for the run, None before the first plan."""
        from quadsim.controllers.sampled_trajectories import (
            take_snapshot,  # here: it loads the compiler
        )

        return take_snapshot(self.planner)

    def _make_changes(self, t: float) -> None:
        """Make the changes that are due at t [s], the last of which has all numbers."""
        due = None
        while self._next is not None and self._next.t <= t:
            due = self._next
            self._next = next(self._coming, None)
        if due is not None:
            self.change(due.after(self._numbers))
