"""A planner that minds the other vehicles of its race."""

from __future__ import annotations

from math import dist
from typing import NamedTuple

import numpy as np

from controllers.costs.keep_clear import OtherVehicle
from controllers.in_flight import PlannerInFlight
from controllers.plan import PlanStats
from quadsim.course import Course
from quadsim.dynamics.estimate import Estimate
from quadsim.heat.expectations import Expectation, Outlook, planned_path
from quadsim.heat.patience import Patience
from quadsim.heat.rules import Progress
from quadsim.heat.traffic import ExpectedPath, Sighting, Traffic
from quadsim.racing.referee import way_left

# Distance within which a vehicle ahead is followed [m]
CLOSE = 3.0


class Eyes:
    """Eyes see the other vehicles of a race, in the time of their own vehicle's flight."""

    def __init__(self, number: int, traffic: Traffic, start_time: float, course: Course):
        """Take the place of a vehicle in a race.

        Args:
            number: index of the vehicle.
            traffic: what is known of all vehicles.
            start_time: when its flight starts, in the time of the race [s].
            course: the map, by which it sees who is ahead.
        """
        self.number = number
        self.traffic = traffic
        self.start_time = start_time
        self._course = course

    def look(self, t: float) -> dict[int, Sighting]:
        """Return what is seen of the others at t [s] of the flight: number -> Sighting."""
        return self.traffic.sightings(self.number, t + self.start_time)

    def is_behind(self, seen: Sighting, estimate: Estimate) -> bool:
        """Return whether another vehicle is behind this one."""
        own = self._progress(estimate.target, tuple(estimate.x[:3].tolist()))
        return self._progress(seen.passed, seen.position).is_behind(own)

    def follows(self, seen: Sighting, estimate: Estimate) -> bool:
        """Return whether another vehicle is closely ahead of this one."""
        near = dist(seen.position, estimate.x[:3].tolist()) < CLOSE
        return near and not self.is_behind(seen, estimate)

    def _progress(self, passed: int, position: tuple[float, ...]) -> Progress:
        x, y, z = position
        gates = self._course.gates
        return Progress(passed, way_left(gates[passed % len(gates)], (x, y, z)))


class Racecraft(NamedTuple):
    """Rules for vehicles ahead and behind."""

    # factor on the weight of keeping clear of vehicles that are behind
    ahead_share: float = 1.0
    # the distance that is kept, by the time lost behind a vehicle; None: always the same
    patience: Patience | None = None


class AwarePlanner:
    """A controller whose planner keeps clear of where the others are expected."""

    def __init__(
        self,
        planner: PlannerInFlight,
        eyes: Eyes,
        expectation: Expectation | None,
        others: dict[int, OtherVehicle],
        racecraft: Racecraft | None = None,
        tells: bool = False,
    ):
        """Wrap a planner.

        Args:
            planner: the planner.
            eyes: what is seen of the others.
            expectation: what is expected of them; None: they are ignored.
            others: number -> term of the planner's cost, for each other vehicle.
            racecraft: its rules for vehicles ahead and behind; None: all are alike.
            tells: whether the others are told the plan.
        """
        self._planner = planner
        self._eyes = eyes
        self._expectation = expectation
        self._others = others
        self._racecraft = racecraft or Racecraft()
        self._tells = tells
        self._last: Estimate | None = None  # that was planned from
        # the paths that were expected for the last plan, for display
        self.expected: dict[int, ExpectedPath] = {}

    @property
    def rest(self) -> np.ndarray:
        """The planner's control at rest.  (n_u,)"""
        return self._planner.rest

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the control to apply and statistics of the plan; see MPPI.control."""
        if self._expectation:
            self._mind_others(estimate, self._expectation)
        answer = self._planner.control(estimate)
        self._last = estimate
        path = self._own_path() if self._tells else None
        if path:
            self._eyes.traffic.tell(self._eyes.number, path)
        return answer

    def _own_path(self) -> ExpectedPath | None:
        """Return the path of the last plan, in the time of the race."""
        if self._last is None:
            return None
        return planned_path(self._planner.planner, self._last, self._eyes.start_time)

    def _mind_others(self, estimate: Estimate, expectation: Expectation) -> None:
        """Let the terms of the cost know where the others are expected."""
        seen = self._eyes.look(estimate.t)
        behind = frozenset(m for m in seen if self._eyes.is_behind(seen[m], estimate))
        self.expected = expectation.paths(Outlook(seen, behind, self._own_path))

        # The times at which the steps of the horizon end
        config = self._planner.planner.config
        acts = estimate.t if estimate.acts is None else estimate.acts
        steps = np.arange(1, config.horizon + 1)
        times = self._eyes.start_time + acts + config.dt * steps

        ahead_share, patience = self._racecraft
        for m, other in self._others.items():
            if m not in seen:
                other.expect_nowhere()
                continue
            share = keep_share = 1.0
            if m in behind:
                share = ahead_share
            if patience:
                follows = self._eyes.follows(seen[m], estimate)
                keep_share = patience.share(m, estimate.t, follows)
            other.expect(self.expected[m].at(times), share, keep_share)
