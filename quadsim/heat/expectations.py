"""Predictions of the paths of the other vehicles in a race."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from quadsim.dynamics.estimate import Estimate
from quadsim.dynamics.expected_path import ExpectedPath, OtherVehicle
from quadsim.dynamics.quadrotor import Control, ModelParams, State
from quadsim.heat.traffic import Sighting, Traffic
from quadsim.rotation import between, to_world
from quadsim.vehicle import GRAVITY

if TYPE_CHECKING:
    from quadsim.controllers.mppi import MPPI

# The path that a vehicle has planned for itself; None before its first plan
OwnPath = Callable[[], ExpectedPath | None]


class Perceived(NamedTuple):
    """The perceived state of a race from which a vehicle predicts the paths of the others."""

    # present sightings of the other vehicles by number
    seen: dict[int, Sighting]
    # the numbers of the vehicles behind it
    behind: frozenset[int]
    # returns the path that it has planned for itself
    own: OwnPath


class Expectation(Protocol):
    """A prediction of the paths of other vehicles."""

    def paths(self, perceived: Perceived) -> dict[int, ExpectedPath]:
        """Return the predicted path of each visible vehicle by number."""
        ...


class ConstantVelocity:
    """The prediction that other vehicles keep their perceived velocities."""

    def paths(self, perceived: Perceived) -> dict[int, ExpectedPath]:
        """Return a straight line for each vehicle."""
        return {m: straight(sighting) for m, sighting in perceived.seen.items()}


class AnnouncedPlans:
    """The prediction that other vehicles fly the plans that they have announced."""

    def __init__(self, traffic: Traffic):
        """Use the plans that are announced in the traffic."""
        self._traffic = traffic

    def paths(self, perceived: Perceived) -> dict[int, ExpectedPath]:
        """Return the announced plans, and a straight line for a vehicle without one."""
        return {
            m: self._traffic.announced(m) or straight(sighting)
            for m, sighting in perceived.seen.items()
        }


# Control periods in a step of the plan of another vehicle's flight, and the least number of them
# from one plan to the next. Long steps let few samples find a good plan.
OPPONENT_STEPS = 3
# Standard deviation of the thrust that is taken from a plan [m/s^2]
THRUST_ERROR = 10.0


class OpponentModel(NamedTuple):
    """The planner that predicts the flight of another vehicle."""

    # its cost has terms that keep clear of all vehicles but the opponent itself
    planner: MPPI
    model: ModelParams


class OwnPlans:
    """A prediction that plans the flights of other vehicles with the vehicle's own planner.

    Announced plans are not used. The plan of an opponent starts from its perceived state, and keeps
    clear of the predicted paths of the other vehicles. An opponent behind also keeps clear of the
    path that the vehicle itself has planned. An opponent ahead does not: it has not agreed to make
    room, so an overtake that relied on it would end in a contact.

    At most one opponent is planned in a control period, in turn, so that the time does not grow
    with their number. Until its next turn an opponent is predicted to follow its last plan.

    Body rates and thrust are not perceived; they are computed from changes of attitude and
    velocity.
    """

    def __init__(
        self, number: int, opponent: Callable[[int], OpponentModel], velocity_noise: float = 0.0
    ):
        """Begin without a plan.

        Args:
            number: index of the vehicle itself.
            opponent: function that returns the planner for another vehicle, by its number.
            velocity_noise: standard deviation of perceived velocities, per axis [m/s].
        """
        self._velocity_noise = velocity_noise
        self._number = number
        self._new_opponent = opponent
        self._opponents: dict[int, OpponentModel] = {}
        # number -> last planned path
        self._paths: dict[int, ExpectedPath] = {}
        # a recent plan of the vehicle itself
        self._own: ExpectedPath | None = None
        # sightings of the last control period
        self._before: dict[int, Sighting] = {}
        # number of control periods so far
        self._periods = 0

    def paths(self, perceived: Perceived) -> dict[int, ExpectedPath]:
        """Return the planned paths; each call renews one of them, the first call all."""
        seen = perceived.seen
        numbers = sorted(seen)
        new = [m for m in numbers if m not in self._paths]
        self._periods += 1
        turn = self._periods % max(len(numbers), OPPONENT_STEPS)
        if not new and turn < len(numbers):
            new = [numbers[turn]]
        if new:
            if turn == 0 or self._own is None:
                self._own = perceived.own()
            around = {m: self._paths[m] for m in numbers if m in self._paths}
            for m in new:
                # Only a vehicle that is behind keeps clear of this one.
                if m in perceived.behind and self._own is not None:
                    around_it = {**around, self._number: self._own}
                else:
                    around_it = around
                self._paths[m] = self._plan(m, seen[m], around_it)
        self._before = seen
        return {m: self._paths[m] for m in numbers}

    def _plan(self, m: int, seen: Sighting, around: dict[int, ExpectedPath]) -> ExpectedPath:
        """Return the planned path of one vehicle.

        Args:
            m: number of the vehicle.
            seen: perceived state of the vehicle.
            around: the paths of the vehicles around it.
        """
        # here: it loads the compiler
        from quadsim.controllers.sampled_trajectories import planned_path

        opponent = self._opponents.get(m)
        if opponent is None:
            opponent = self._opponents[m] = self._new_opponent(m)
            acting = Control(*opponent.planner.rest)
        else:
            # the first control of the last plan
            acting = Control(*opponent.planner.clipped(opponent.planner.plan[0]))
        acting = self._seen_to_act(m, seen, acting, opponent.model)
        x = State.of(
            position=seen.position,
            velocity=seen.velocity,
            attitude=seen.attitude,
            body_rates=acting.body_rates,
            thrust=acting.thrust,
            angular_acceleration=(0.0, 0.0, 0.0),
        )
        others = tuple(OtherVehicle(n, around[n]) for n in around)
        estimate = Estimate(seen.t, np.array(x), seen.passed, others=others)
        opponent.planner.control(estimate)
        return planned_path(opponent.planner, estimate)

    def _seen_to_act(self, m: int, seen: Sighting, planned: Control, model: ModelParams) -> Control:
        """Return another vehicle's body rates and thrust, from changes of its perceived state.

        Args:
            m: number of the vehicle.
            seen: perceived state of the vehicle.
            planned: control of the vehicle by its last plan.
            model: model of a vehicle.
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

        # Weigh measurement and plan by their variances.
        variance = 2.0 * (self._velocity_noise / dt) ** 2
        trust = THRUST_ERROR**2 / (THRUST_ERROR**2 + variance)
        thrust = planned.thrust + trust * (measured - planned.thrust)
        return Control(wx, wy, wz, max(thrust, 0.0))


def straight(seen: Sighting) -> ExpectedPath:
    """Return the path at constant velocity."""
    here = np.array(seen.position)
    return ExpectedPath(seen.t, 1.0, np.array([here, here + np.array(seen.velocity)]))
