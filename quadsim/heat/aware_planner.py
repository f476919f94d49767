"""A planner that keeps clear of the other vehicles of its race."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import dist
from typing import NamedTuple

import numpy as np

from quadsim.controllers.costs.keep_clear import KeepClear
from quadsim.controllers.in_flight import PlannerInFlight
from quadsim.controllers.plan import PlanStats
from quadsim.course import Course
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.expected_path import ExpectedPath, OtherVehicle
from quadsim.heat.expectations import Expectation, Perceived
from quadsim.heat.patience import Patience
from quadsim.heat.traffic import Sighting, Traffic
from quadsim.racing.along import Along

# Distance within which a vehicle ahead is followed [m]
CLOSE = 3.0


class Perception:
    """The perception of the other vehicles by one vehicle, in the time of its own flight."""

    def __init__(self, number: int, traffic: Traffic, start_time: float, course: Course):
        """Prepare the perception of one vehicle.

        Args:
            number: index of the vehicle.
            traffic: states and announced plans of all vehicles.
            start_time: start of the vehicle's flight, in the time of the race [s].
            course: the map, by which it is decided which vehicle is ahead.
        """
        self.number = number
        self.traffic = traffic
        self.start_time = start_time
        self._course = course

    def sightings(self, t: float) -> dict[int, Sighting]:
        """Return the sightings of the other vehicles by number, at t [s] of the flight."""
        return self.traffic.sightings(self.number, t + self.start_time)

    def is_behind(self, seen: Sighting, estimate: Estimate) -> bool:
        """Return whether another vehicle is behind this one."""
        own = self._along(estimate.target, tuple(estimate.x[:3].tolist()))
        return self._along(seen.passed, seen.position) < own

    def follows(self, seen: Sighting, estimate: Estimate) -> bool:
        """Return whether this vehicle is closely behind another one."""
        near = dist(seen.position, estimate.x[:3].tolist()) < CLOSE
        return near and not self.is_behind(seen, estimate)

    def _along(self, passed: int, position: tuple[float, ...]) -> Along:
        """Return the progress of a vehicle at a position [m]."""
        x, y, z = position
        return Along.of(self._course, passed, (x, y, z))


class Tactics(NamedTuple):
    """The clearances that a vehicle keeps from vehicles ahead and behind."""

    # factor on the weight of keeping clear of vehicles that are behind
    ahead_share: float = 1.0
    # the distance that is kept, by the time lost behind a vehicle; None: always the same
    patience: Patience | None = None


class AwarePlanner:
    """A controller that adds the other vehicles to its estimate, and plans with that.

    The estimate has the predicted paths of the other vehicles. Tactics change only the weights of
    the cost terms for the clearance.
    """

    def __init__(
        self,
        planner: PlannerInFlight,
        perception: Perception,
        expectation: Expectation | None,
        terms: Mapping[int, KeepClear],
        tactics: Tactics | None = None,
        announces: bool = False,
    ):
        """Prepare a planner for a race.

        Args:
            planner: the planner.
            perception: perception of the other vehicles.
            expectation: prediction of their paths; None: they are ignored.
            terms: the cost term for the clearance from each vehicle, by the vehicle's number.
            tactics: clearances from vehicles ahead and behind; None: the same for both.
            announces: whether the vehicle announces its plans to the others.
        """
        self._planner = planner
        self._perception = perception
        self._expectation = expectation
        self._terms = terms
        self._tactics = tactics or Tactics()
        self._announces = announces
        # number -> factors on weight and distance that the planner uses at present
        self._shares: dict[int, tuple[float, float]] = {}
        # from which the last plan was made
        self._last: Estimate | None = None

    @property
    def rest(self) -> np.ndarray:
        """The planner's control at rest.  (n_u,)"""
        return self._planner.rest

    def control(self, estimate: Estimate, /) -> tuple[np.ndarray, PlanStats]:
        """Return the control to apply, and statistics of the plan; see MPPI.control."""
        others: tuple[OtherVehicle, ...] = ()
        if self._expectation:
            perceived = self._perceived(estimate)
            paths = self._expectation.paths(perceived)
            others = tuple(OtherVehicle(m, paths[m]) for m in paths)
            self._use_tactics(perceived, estimate)
        known = replace(estimate, others=others, start_time=self._perception.start_time)
        answer = self._planner.control(known)
        self._last = known
        path = self._own_path() if self._announces else None
        if path:
            self._perception.traffic.announce(self._perception.number, path)
        return answer

    def last_others(self) -> tuple[OtherVehicle, ...]:
        """Return the other vehicles as predicted for the last plan."""
        return self._last.others if self._last else ()

    def _perceived(self, estimate: Estimate) -> Perceived:
        """Return the perceived state of the race at the time of an estimate."""
        seen = self._perception.sightings(estimate.t)
        behind = frozenset(m for m in seen if self._perception.is_behind(seen[m], estimate))
        return Perceived(seen, behind, self._own_path)

    def _use_tactics(self, perceived: Perceived, estimate: Estimate) -> None:
        """Set the weights and the clearances of the planner's cost terms for other vehicles."""
        ahead_share, patience = self._tactics
        for m, term in self._terms.items():
            if m not in perceived.seen:
                continue
            weight_share = ahead_share if m in perceived.behind else 1.0
            keep_share = 1.0
            if patience:
                follows = self._perception.follows(perceived.seen[m], estimate)
                keep_share = patience.share(m, estimate.t, follows)
            shares = weight_share, keep_share
            if shares != self._shares.get(m, (1.0, 1.0)):
                self._shares[m] = shares
                self._planner.set_numbers(term.name, **term.scaled(*shares))

    def _own_path(self) -> ExpectedPath | None:
        """Return the path of the last plan; None before the first one."""
        if self._last is None:
            return None
        return self._planner.planned_path(self._last)
