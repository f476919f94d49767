"""Initial guesses for the optimiser, from straight lines, a run or a coarser solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import dist, sqrt
from typing import NamedTuple

import numpy as np

from quadsim.dynamics.quadrotor import ATTITUDE, STATE, VELOCITY, State
from quadsim.limit.dynamics import Dynamics
from quadsim.limit.limits import Solution
from quadsim.limit.route import INSIDE, Route, Segment, segments
from quadsim.vehicle import GRAVITY

# Least duration of a leg of straight lines [s]
SHORT = 0.2
# Time between the two states at a corner of straight lines [s]
SOON = 1e-6
# Least duration of a segment [s]
LEAST = 0.01
# Speeds of straight lines, as shares of the speed that the vehicle could reach on a mean leg
SHARES = (0.2, 0.3, 0.45)


class FlownRun(NamedTuple):
    """A run from which an initial guess is made."""

    name: str
    # Columns of the run
    telemetry: dict[str, np.ndarray]
    # Times of the gate passes [s]
    passes: list[float]


@dataclass(frozen=True)
class Guess:
    """An initial guess: states and controls of a model over time, and the times of passes."""

    name: str
    # Times [s]  (n,)
    t: np.ndarray
    # States  (n, n_x)
    x: np.ndarray
    # Controls  (n, n_u)
    u: np.ndarray
    # Times of arrival at the points of the route except the first [s]  (points - 1,)
    passes: np.ndarray

    def states(self, t: np.ndarray) -> np.ndarray:
        """Return states (k, n_x) at times t (k,), with unit quaternions."""
        x = _interpolated(t, self.t, _continuous(self.x))
        x[:, ATTITUDE] /= np.linalg.norm(x[:, ATTITUDE], axis=1, keepdims=True)
        return x

    def controls(self, t: np.ndarray) -> np.ndarray:
        """Return controls (k, n_u) at times t (k,)."""
        return _interpolated(t, self.t, self.u)

    def durations(self, plan: Sequence[Segment], route: Route) -> list[float]:
        """Return the durations of a route's segments [s].

        A gate's entry and exit lie `route.reach` before and behind its plane.
        """
        speeds = np.linalg.norm(self.states(self.passes)[:, VELOCITY], axis=1)
        beyond_plane = {"approach": -route.reach, "inside": route.reach, "finish": 0.0}
        ends = [0.0]
        for segment in plan:
            speed = max(speeds[segment.target], 1.0)
            end = self.passes[segment.target] + beyond_plane[segment.kind] / speed
            ends.append(max(end, ends[-1] + LEAST))
        return np.diff(ends).tolist()


def line_speeds(route: Route, acceleration: float) -> list[float]:
    """Return the speeds of initial guesses along straight lines [m/s].

    They are SHARES of the speed that an acceleration [m/s^2] from rest gives on a mean leg.
    """
    mean = sum(route.legs) / len(route.legs)
    return [round(share * sqrt(2.0 * acceleration * mean), 1) for share in SHARES]


def straight(points: Sequence[Sequence[float]], model: Dynamics, speed: float) -> Guess:
    """Return a level flight from point to point at constant speed, as a guess.

    Args:
        points: positions, see Route.points [m].
        model: the model of the returned states and controls.
        speed: speed of the flight [m/s].
    """
    states: list[State] = []
    times: list[float] = []
    passes: list[float] = []
    lengths: list[float] = []
    for before, after in pairwise(np.array(points)):
        lengths.append(max(dist(before, after), SHORT * speed))
        duration = lengths[-1] / speed
        end = sum(lengths) / speed
        # Two states per leg: a corner has one state for each adjacent leg
        for position in (before, after):
            state = State.of(
                position=position,
                velocity=(after - before) / duration,
                attitude=(1.0, 0.0, 0.0, 0.0),
                body_rates=(0.0, 0.0, 0.0),
                thrust=GRAVITY,
                angular_acceleration=(0.0, 0.0, 0.0),
            )
            states.append(state)
        times += [end - duration + SOON, end]
        passes.append(end)
    name = f"straight lines at {speed:g} m/s"
    return _of_states(name, model, np.array(times), np.array(states), np.array(passes))


def flown(flight: FlownRun, model: Dynamics) -> Guess:
    """Return a run as a guess, with states and controls of a model."""
    states = np.column_stack([flight.telemetry[column] for column in STATE])
    passes = np.array(flight.passes)
    return _of_states(flight.name, model, flight.telemetry["t"], states, passes)


def solved(name: str, s: Solution, route: Route) -> Guess:
    """Return a solution of the same route and model as a guess for another mesh."""
    passes = []
    one_each = [1] * len(route.gates)
    for segment in segments(route, one_each):
        if segment.kind == "approach":
            continue
        ends = s.t[1:][s.target == segment.target]
        if segment.kind == "inside":
            # The plane lies in the middle between entry and exit
            passes.append(0.5 * (ends[-1] + ends[-1 - INSIDE]))
        else:
            passes.append(ends[-1])
    controls = np.vstack([s.u, s.u[-1:]])
    return Guess(name, s.t, s.x, controls, np.array(passes))


def _of_states(
    name: str, model: Dynamics, t: np.ndarray, states: np.ndarray, passes: np.ndarray
) -> Guess:
    """Return a guess with a model's states and controls from states of the quadrotor.

    Args:
        name: name of the guess.
        model: the model.
        t: times [s]  (n,).
        states: states of the quadrotor, columns as in State  (n, 17).
        passes: times of arrival at the points of the route except the first [s].
    """
    x = []
    u = []
    for row in states:
        state, control = model.of_flight(State(*row))
        x.append(state)
        u.append(control)
    return Guess(name, t, np.array(x), np.array(u), passes)


def _interpolated(t: np.ndarray, known: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return rows (k, columns) at times t (k,), interpolated linearly from times `known` (n,)."""
    return np.column_stack([np.interp(t, known, column) for column in rows.T])


def _continuous(x: np.ndarray) -> np.ndarray:
    """Return states (n, n_x) with the quaternion signs chosen for continuity over time."""
    x = x.copy()
    same = (x[1:, ATTITUDE] * x[:-1, ATTITUDE]).sum(axis=1) >= 0.0
    x[1:, ATTITUDE] *= np.cumprod(np.where(same, 1.0, -1.0))[:, None]
    return x
