"""Changes of a planner's numbers in flight: made on the page, recorded, and made again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from controllers.plan import PlannerSnapshot, PlanStats
from controllers.presets import Planner
from quadsim.config.parts import is_registered, plain
from quadsim.dynamics.estimate import Estimate
from quadsim.files.exact_json import exactly
from quadsim.record.schema import ChangedPlanner, NumberChange

if TYPE_CHECKING:
    from controllers.mppi import MPPI


def changeable_numbers(planner: Planner) -> dict[str, Any]:
    """Return the numbers of a planner that may change in flight, as a NumberChange has them."""
    return {"sampling": plain(planner.sampling), "mppi": plain(planner.mppi)}


def planner_after(change: NumberChange, planner: Planner) -> Planner:
    """Return a planner with its numbers after a change.

    Raises:
        msgspec.ValidationError: the change was read from a file that is damaged.
    """
    numbers = exactly(change.planner, ChangedPlanner)
    sampling = planner.sampling
    if is_registered(sampling):
        sampling = exactly(numbers.sampling, type(sampling))
    return replace(planner, sampling=sampling, mppi=numbers.mppi)


class ChangeablePlanner:
    """A planner whose numbers may change between two plans; see quadsim.racing.flight.Controller.

    Attributes:
        planner: the MPPI planner that flies at present.
    """

    def __init__(
        self,
        planner: MPPI,
        numbers: Planner,
        make: Callable[[Planner], MPPI],
        changes: Sequence[NumberChange] = (),
    ):
        """Begin with the planner of the start.

        Args:
            planner: the planner.
            numbers: its numbers.
            make: makes a planner of this flight with other numbers.
            changes: changes to make in flight, in the order of their times.
        """
        self.planner = planner
        self._numbers = numbers
        self._make = make
        self._coming = iter(changes)
        self._next = next(self._coming, None)

    @property
    def rest(self) -> np.ndarray:
        """The control at rest, which is applied until the first plan is ready.  (n_u,)"""
        return self.planner.rest

    def present(self) -> MPPI:
        """Return the planner that flies at present."""
        return self.planner

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Make the changes that are due, and return the planner's control."""
        due = None
        while self._next is not None and self._next.t <= estimate.t:
            due = self._next
            self._next = next(self._coming, None)
        if due is not None:
            self.change(planner_after(due, self._numbers))
        return self.planner.control(estimate)

    def change(self, numbers: Planner) -> None:
        """Plan with other numbers from the next plan on, which begins with the last one."""
        planner = self._make(numbers)
        planner.continue_from(self.planner)
        # A temperature that was reached by steering to the target ESS stays.
        if numbers.mppi.temperature == self._numbers.mppi.temperature:
            planner.temperature = self.planner.temperature
        self.planner = planner
        self._numbers = numbers

    def snapshot(self) -> PlannerSnapshot | None:
        """Return the snapshot of the last plan that is stored with the run."""
        from controllers.sampled_trajectories import take_snapshot  # here: it loads the compiler

        return take_snapshot(self.planner)
