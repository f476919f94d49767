"""Expectations predict the path that each of the other vehicles will fly."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from controllers.costs.keep_clear import OtherVehicle
from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.quadrotor import Control, ModelParams, State
from quadsim.heat.traffic import ExpectedPath, Sighting, Traffic
from quadsim.rotation import between, to_world
from quadsim.vehicle import GRAVITY

if TYPE_CHECKING:
    from controllers.mppi import MPPI

# The path that a vehicle has planned for itself; None before its first plan
OwnPath = Callable[[], ExpectedPath | None]


class Outlook(NamedTuple):
    """An outlook holds what a vehicle knows of its race when it predicts the others' paths."""

    # what is seen of the others now: number -> Sighting
    seen: dict[int, Sighting]
    # the numbers of those that are behind it
    behind: frozenset[int]
    # returns the path that it has planned
    own: OwnPath


class Expectation(Protocol):
    """A way to expect the paths of other vehicles."""

    def paths(self, outlook: Outlook) -> dict[int, ExpectedPath]:
        """Return the path of each vehicle that is seen: number -> path."""
        ...


class ConstantVelocity:
    """Expects that the others go on at the velocity that is seen."""

    def paths(self, outlook: Outlook) -> dict[int, ExpectedPath]:
        """Return straight lines."""
        return {m: straight(sighting) for m, sighting in outlook.seen.items()}


class ToldPlans:
    """Expects that the others fly the plans that they have told."""

    def __init__(self, traffic: Traffic):
        """Take what is told from the traffic."""
        self._traffic = traffic

    def paths(self, outlook: Outlook) -> dict[int, ExpectedPath]:
        """Return the told plans; a straight line for who has told none."""
        return {
            m: self._traffic.told(m) or straight(sighting) for m, sighting in outlook.seen.items()
        }


# Control periods in a step of the plan of another vehicle's flight, and the least number of them
# from one plan to the next. Long steps let few samples find a good plan.
OPPONENT_STEPS = 3
# Standard deviation of the thrust that is taken from a plan [m/s^2]
THRUST_ERROR = 10.0


class Opponent(NamedTuple):
    """How the flight of another vehicle is planned."""

    planner: MPPI
    model: ModelParams
    # the terms by which it keeps clear of all vehicles but itself: number -> term
    others: dict[int, OtherVehicle]


class OwnPlans:
    """Plans the others' flights by itself, with its own model, cost and sampling.

    Nothing is told: each plan starts from where the other vehicle is seen, and keeps clear of what
    is expected of the rest. A vehicle that is behind also keeps clear of what this one has planned.
    A vehicle that is ahead is not expected to: it has not agreed to make room, so an overtake that
    relied on it would end in a contact.

    The others are planned in turn, at most one of them in a control period, so that the time does
    not grow with their number. Meanwhile a vehicle is expected to follow its last plan.

    Body rates and thrust are not seen: they follow from how attitude and velocity change.
    """

    def __init__(
        self, number: int, opponent: Callable[[int], Opponent], velocity_noise: float = 0.0
    ):
        """Begin without a plan.

        Args:
            number: index of the vehicle itself.
            opponent: returns how the flight of a vehicle is planned.
            velocity_noise: standard deviation of the velocities that are seen, per axis [m/s].
        """
        self._velocity_noise = velocity_noise
        self._number = number
        self._new_opponent = opponent
        self._opponents: dict[int, Opponent] = {}
        self._paths: dict[int, ExpectedPath] = {}
        self._own: ExpectedPath | None = None  # that the vehicle itself has planned, not long ago
        self._before: dict[int, Sighting] = {}  # what was seen a control period ago
        self._periods = 0  # that have passed

    def paths(self, outlook: Outlook) -> dict[int, ExpectedPath]:
        """Return the planned paths, of which at most one is new, but for the first time."""
        seen = outlook.seen
        numbers = sorted(seen)
        new = [m for m in numbers if m not in self._paths]
        self._periods += 1
        turn = self._periods % max(len(numbers), OPPONENT_STEPS)
        if not new and turn < len(numbers):
            new = [numbers[turn]]
        if new:
            if turn == 0 or self._own is None:
                self._own = outlook.own()
            around = {m: self._paths[m] for m in numbers if m in self._paths}
            for m in new:
                # Only a vehicle that is behind keeps clear of this one.
                if m in outlook.behind and self._own is not None:
                    around_it = {**around, self._number: self._own}
                else:
                    around_it = around
                self._paths[m] = self._plan(m, seen[m], around_it)
        self._before = seen
        return {m: self._paths[m] for m in numbers}

    def _plan(self, m: int, seen: Sighting, around: dict[int, ExpectedPath]) -> ExpectedPath:
        """Return the planned path of one vehicle.

        Args:
            m: its number.
            seen: where it is seen.
            around: the paths of the vehicles around it.
        """
        opponent = self._opponents.get(m)
        if opponent is None:
            opponent = self._opponents[m] = self._new_opponent(m)
            acting = Control(*opponent.planner.rest)
        else:
            # the first control of the plan so far
            acting = Control(*opponent.planner.clipped(opponent.planner.plan[0]))
        acting = self._seen_to_act(m, seen, acting, opponent.model)
        planner = opponent.planner
        times = seen.t + planner.config.dt * np.arange(1, planner.config.horizon + 1)
        for n, other in opponent.others.items():
            if n in around:
                other.expect(around[n].at(times))
            else:
                other.expect_nowhere()

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

    def _seen_to_act(self, m: int, seen: Sighting, planned: Control, model: ModelParams) -> Control:
        """Return the body rates and the thrust of another vehicle, by how its flight changes.

        Args:
            m: its number.
            seen: where it is seen.
            planned: its control by the plan so far.
            model: the model of a vehicle.
        """
        before = self._before.get(m)
        if before is None or before.t >= seen.t:
            return planned
        dt = seen.t - before.t
        wx, wy, wz = (turn / dt for turn in between(before.attitude, seen.attitude))

        # The acceleration that the rotors give, along the thrust
        v = np.array(seen.velocity)
        acceleration = (v - np.array(before.velocity)) / dt
        lift = acceleration + model.drag * v + np.array((0.0, 0.0, GRAVITY))
        measured = float(lift @ np.array(to_world(seen.attitude, (0.0, 0.0, 1.0))))
        measured /= model.thrust_gain

        # The plan counts as much as the noise of the measurement makes it the better guess.
        variance = 2.0 * (self._velocity_noise / dt) ** 2
        trust = THRUST_ERROR**2 / (THRUST_ERROR**2 + variance)
        thrust = planned.thrust + trust * (measured - planned.thrust)
        return Control(wx, wy, wz, max(thrust, 0.0))


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
    found = planner.rollout.trajectories(estimate.x, v, estimate.target)
    positions = np.vstack([estimate.x[:3], found.states[0, :, :3]])  # (T + 1, 3)
    return ExpectedPath(acts + ahead, dt, positions.astype(float))
