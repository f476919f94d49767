"""Expectations predict the path that each of the other vehicles will fly."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np

from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control, State
from quadsim.racing.traffic import ExpectedPath, Sighting, Traffic

if TYPE_CHECKING:
    from controllers.mppi import MPPI


class Expectation(Protocol):
    """A way to expect the paths of other vehicles."""

    def paths(self, seen: dict[int, Sighting]) -> dict[int, ExpectedPath]:
        """Return the path of each vehicle that is seen: number -> path.

        Args:
            seen: what is seen of the others now.
        """
        ...


class ConstantVelocity:
    """Expects that the others go on at the velocity that is seen."""

    def paths(self, seen: dict[int, Sighting]) -> dict[int, ExpectedPath]:
        """Return straight lines."""
        return {m: straight(sighting) for m, sighting in seen.items()}


class ToldPlans:
    """Expects that the others fly the plans that they have told."""

    def __init__(self, traffic: Traffic):
        """Take what is told from the traffic."""
        self._traffic = traffic

    def paths(self, seen: dict[int, Sighting]) -> dict[int, ExpectedPath]:
        """Return the told plans; a straight line for who has told none."""
        return {m: self._traffic.told(m) or straight(seen[m]) for m in seen}


# Control periods from one plan of another vehicle's flight to the next
OWN_PERIODS = 2


class OwnPlans:
    """Plans the others' flights by itself, with its own model, cost and sampling.

    Nothing is told: each plan starts from where the other vehicle is seen. The others are planned
    in turn, one of them in each OWN_PERIODS control periods, so that the time does not grow with
    their number. Meanwhile a vehicle is expected to follow the last plan that was made for it.
    """

    def __init__(self, new_planner: Callable[[int], MPPI]):
        """Begin without a plan.

        new_planner: makes the planner of a vehicle's flight.
        """
        self._new_planner = new_planner
        self._planners: dict[int, MPPI] = {}
        self._paths: dict[int, ExpectedPath] = {}
        self._periods = 0  # that have passed

    def paths(self, seen: dict[int, Sighting]) -> dict[int, ExpectedPath]:
        """Return the planned paths, of which at most one is new, but for the first time."""
        numbers = sorted(seen)
        self._periods += 1
        turn, waits = divmod(self._periods, OWN_PERIODS)
        new = [m for m in numbers if m not in self._paths]
        if not new and numbers and not waits:
            new = [numbers[turn % len(numbers)]]
        for m in new:
            self._paths[m] = self._plan(m, seen[m])
        return {m: self._paths[m] for m in numbers}

    def _plan(self, m: int, seen: Sighting) -> ExpectedPath:
        """Return the planned path of one vehicle."""
        planner = self._planners.get(m)
        if planner is None:
            planner = self._planners[m] = self._new_planner(m)
            acting = Control(*planner.rest)
        else:
            # What is not seen, body rates and thrust, is that of the plan so far.
            acting = Control(*planner.clipped(planner.plan[0]))
        x = State.of(
            position=seen.position,
            velocity=seen.velocity,
            attitude=seen.attitude,
            body_rates=acting.body_rates,
            thrust=acting.thrust,
            angular_acceleration=(0.0, 0.0, 0.0),
        )
        estimate = Estimate(seen.t, np.array(x), seen.passed)
        planner.control(estimate)
        return planned_path(planner, estimate)


def straight(seen: Sighting) -> ExpectedPath:
    """Return the path at constant velocity."""
    here = np.array(seen.position)
    return ExpectedPath(seen.t, 1.0, np.array([here, here + np.array(seen.velocity)]))


def planned_path(planner: MPPI, estimate: Estimate, ahead: float = 0.0) -> ExpectedPath:
    """Return the path of a planner's present plan.

    Args:
        planner: the planner, which has planned from this estimate.
        estimate: state in which its plan begins to act.
        ahead: added to the times of the path [s].
    """
    dt = planner.config.dt
    acts = estimate.t if estimate.acts is None else estimate.acts
    v = planner.clipped(planner.plan).T[None]  # (1, n_u, T)
    paths, _ = planner.rollout.paths(estimate.x, v, estimate.target)
    positions = np.vstack([estimate.x[:3], paths[0]])  # (T + 1, 3)
    return ExpectedPath(acts + ahead, dt, positions.astype(float))
