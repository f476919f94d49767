"""Where the optimiser starts from: straight lines at constant speed, a flight that was flown,
another solution."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from quadsim.dynamics.quadrotor import ATTITUDE, STATE, VELOCITY, State
from quadsim.limit.dynamics import Dynamics
from quadsim.limit.task import INSIDE, Segment, Task, Waypoint, legs, reach, segments
from quadsim.record.limits import Solution
from quadsim.vehicle import GRAVITY

SHORT = 0.2  # [s] that a leg takes at least
SOON = 1e-6  # [s] between the two states at a corner


@dataclass(frozen=True)
class Guess:
    """A flight, roughly: a model's states and controls over time, and when the task's points were
    passed."""

    name: str
    t: np.ndarray  # (n,) [s]
    x: np.ndarray  # (n, n_x)
    u: np.ndarray  # (n, n_u)
    passes: np.ndarray  # (points - 1,) of each point but the first [s]

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States, their attitudes of unit length, and controls.  t (k,) -> (k, n_x), (k, n_u)"""
        x, u = (
            np.column_stack([np.interp(t, self.t, c) for c in rows.T])
            for rows in (_continuous(self.x), self.u)
        )
        x[:, ATTITUDE] /= np.linalg.norm(x[:, ATTITUDE], axis=1, keepdims=True)
        return x, u

    def durations(self, plan: list[Segment], task: Task) -> list[float]:
        """Of the segments [s]; a gate's entry and exit lie `reach` before and behind its plane."""
        speeds = np.linalg.norm(self.at(self.passes)[0][:, VELOCITY], axis=1)
        ends = [0.0]
        for s in plan:
            gate = s.target < len(task.targets) and not isinstance(task.targets[s.target], Waypoint)
            aside = (
                {"approach": -reach(task), "inside": reach(task)}.get(s.kind, 0.0) if gate else 0.0
            )
            ends.append(
                max(self.passes[s.target] + aside / max(speeds[s.target], 1.0), ends[-1] + 0.01)
            )
        return np.diff(ends).tolist()


def speeds(task: Task, acceleration: float) -> list[float]:
    """Of straight lines to start from [m/s]: shares of what this acceleration [m/s^2] gives on a
    mean leg from rest."""
    lengths = legs(task)
    return [
        round(share * sqrt(2.0 * acceleration * sum(lengths) / len(lengths)), 1)
        for share in (0.2, 0.3, 0.45)
    ]


def straight(task: Task, model: Dynamics, speed: float) -> Guess:
    """Level from point to point, at a constant speed [m/s]."""
    points = np.array(task.points)
    lengths = [max(leg, SHORT * speed) for leg in legs(task)]
    passes = np.cumsum(lengths) / speed
    rows, t = [], []
    for i, (leg, end) in enumerate(zip(np.array(lengths) / speed, passes, strict=True)):
        v = (points[i + 1] - points[i]) / leg
        for point in (points[i], points[i + 1]):
            x = State.of(
                position=point,
                velocity=v,
                attitude=(1.0, 0.0, 0.0, 0.0),
                body_rates=(0.0, 0.0, 0.0),
                thrust=GRAVITY,
                angular_acceleration=(0.0, 0.0, 0.0),
            )
            rows.append(x)
        t += [end - leg + SOON, end]
    return _of_flight(
        f"straight lines at {speed:g} m/s", model, np.array(t), np.array(rows), passes
    )


def flown(
    name: str, model: Dynamics, telemetry: dict[str, np.ndarray], passes: list[float]
) -> Guess:
    """telemetry: columns of a run; passes: when it passed the gates [s]."""
    rows = np.column_stack([telemetry[column] for column in STATE])
    return _of_flight(name, model, telemetry["t"], rows, np.array(passes))


def solved(name: str, s: Solution, task: Task) -> Guess:
    """A solution of the same task and model, for another mesh."""
    passes = []
    for segment in (p for p in segments(task, [1] * len(task.points)) if p.kind != "approach"):
        ends = s.t[1:][s.target == segment.target]
        passes.append(
            0.5 * (ends[-1] + ends[-1 - INSIDE]) if segment.kind == "inside" else ends[-1]
        )
    return Guess(name, s.t, s.x, np.vstack([s.u, s.u[-1:]]), np.array(passes))


def _of_flight(
    name: str, model: Dynamics, t: np.ndarray, rows: np.ndarray, passes: np.ndarray
) -> Guess:
    """rows: states in the order of STATE.  (n, 17)"""
    x, u = zip(*(model.of_flight(State(*row)) for row in rows), strict=True)
    return Guess(name, t, np.array(x), np.array(u), passes)


def _continuous(x: np.ndarray) -> np.ndarray:
    """The same attitudes, each with the sign that is nearer to the one before.  (n, n_x)"""
    x = x.copy()
    same = (x[1:, ATTITUDE] * x[:-1, ATTITUDE]).sum(axis=1) >= 0.0
    x[1:, ATTITUDE] *= np.cumprod(np.where(same, 1.0, -1.0))[:, None]
    return x
