"""Does a solution hold? Fine integration from every node, the limits on the way, and the referee's
own test."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from math import hypot
from typing import Any

import numpy as np

from quadsim.dynamics.quadrotor import ATTITUDE, BODY_RATES, POSITION
from quadsim.limit.dynamics import Dynamics
from quadsim.record.limits import Solution

RESIDUAL = 5e-3  # [m] between a node and where the interval before it leads
WORTH = 1e-3  # of the race's time
UNIT = 1e-3  # of |q|
# Of the limit of a body rate, and [rad/s], which may come on top of it between two nodes. The limit
# is one of commands: behind it the rates of a flown vehicle overshoot by up to 8 % (damping 0.62).
RATE = 0.05, 0.06
FOUL = ("hit", "ground", "bounds", "timeout")


@dataclass
class Verified:
    """What the check of a solution has found; it counts where nothing is broken."""

    residual: float = 0.0  # greatest distance from a node to where the interval before it leads [m]
    worth: float = 0.0  # what all residuals are worth in time, |costate . residual| summed [s]
    attitude: float = 0.0  # greatest | |q| - 1 |
    body_rate: tuple[float, ...] = (0.0, 0.0, 0.0)  # greatest about x, y, z [rad/s]
    outcome: str | None = None  # the referee's, where there is one
    events: tuple = ()  # the referee's
    broken: list[str] = field(default_factory=list)  # one line each

    def summary(self) -> dict[str, Any]:
        """As JSON, the events counted by their kind."""
        return asdict(replace(self, events=())) | {
            "events": dict(Counter(e.kind for e in self.events))
        }


def verify(solution: Solution, model: Dynamics, referee: Any = None) -> Verified:
    """referee: of quadsim.race.referee, in the mode that goes on after a hit; it sees every step of
    the integration."""
    found = Verified()
    x, t = solution.x.tolist(), solution.t.tolist()
    for k, u in enumerate(solution.u.tolist()):
        path = list(model.fine(tuple(x[k]), tuple(u), t[k + 1] - t[k]))
        residual = np.array(path[-1]) - solution.x[k + 1]
        found.residual = max(found.residual, float(np.linalg.norm(residual[POSITION])))
        found.worth += abs(float(solution.costate[k] @ residual))
        found.attitude = max(found.attitude, *(abs(hypot(*p[ATTITUDE]) - 1.0) for p in path))
        found.body_rate = tuple(
            np.abs([found.body_rate, *(p[BODY_RATES] for p in path)]).max(axis=0).tolist()
        )
        if referee:
            # what is left at the node is part of the last step
            points = [x[k], *path[:-1], x[k + 1]]
            times = np.linspace(t[k], t[k + 1], len(points)).tolist()
            for i in range(len(path)):
                before, after = tuple(points[i][POSITION]), tuple(points[i + 1][POSITION])
                referee.observe(times[i], before, times[i + 1], after)
    if referee:
        found.outcome = referee.outcome
        found.events = tuple(referee.events)
    found.broken = [
        *_broken(found, solution),
        *_outside(found, solution, model),
        *_incidents(referee),
    ]
    return found


def _broken(found: Verified, solution: Solution) -> Iterator[str]:
    if found.residual > RESIDUAL:
        yield f"nodes: expected at most {RESIDUAL:g} m from the finely integrated path, got {found.residual:.2g}"
    if found.worth > WORTH * solution.time:
        yield f"nodes: expected residuals worth at most {WORTH * solution.time:.2g} s, got {found.worth:.2g}"
    if found.attitude > UNIT:
        yield f"attitude: expected |q| = 1 within {UNIT:g}, got a difference of {found.attitude:.2g}"


def _outside(found: Verified, solution: Solution, model: Dynamics) -> Iterator[str]:
    """Of the vehicle's limits: of the controls at the nodes, where they hold to rounding, of the
    body rates always."""
    allowed = (1.0 + RATE[0]) * model.high[BODY_RATES] + RATE[1]
    if (np.array(found.body_rate) > allowed).any():
        asked, got = (", ".join(f"{w:.3g}" for w in rates) for rates in (allowed, found.body_rate))
        yield f"body rates: expected at most {asked} rad/s, got {got}"
    tolerance = 1e-4 * np.maximum(np.abs(model.u_high), np.abs(model.u_low))
    if (solution.u < model.u_low - tolerance).any() or (
        solution.u > model.u_high + tolerance
    ).any():
        yield "controls: expected all within the vehicle's limits, found one beyond"
    spare = [
        s
        for x, u in zip(solution.x, solution.u, strict=False)
        for s in model.spare(tuple(x), tuple(u))
    ]
    if min(spare, default=0.0) < -1e-2:
        yield f"thrust: expected room for the torque [m/s^2], got {min(spare):.2g}"


def _incidents(referee: Any) -> Iterator[str]:
    for e in referee.events if referee else ():
        if e.kind in FOUL:
            yield f"referee: {e.kind.replace('_', ' ')}{f' at {e.place}' if e.place else ''}, t = {e.t:.3f} s"
    if referee and referee.outcome != "finished":
        yield f"referee: expected a finished race, got {referee.outcome or 'one that goes on'}"
