"""Check a solution by fine integration from every node, by the limits, and by the referee."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import hypot
from typing import Any

import numpy as np

from quadsim.dynamics.quadrotor import ATTITUDE, BODY_RATES, POSITION
from quadsim.limit.dynamics import Dynamics
from quadsim.limit.limits import Check, Solution
from quadsim.racing.events import Event
from quadsim.racing.referee import Referee

# Largest accepted gap between a node and the integrated end of the interval before it [m]
RESIDUAL = 5e-3
# Largest accepted value of all residuals in time, as a share of the race's time
WORTH = 1e-3
# Largest accepted error of |q|
UNIT = 1e-3
# A body rate may exceed its limit between two nodes by RATE_SHARE of the limit plus RATE_MORE
# [rad/s]. The limit applies to commands; the rates of a flown vehicle overshoot it by up to 8 %
# (damping 0.62).
RATE_SHARE = 0.05
RATE_MORE = 0.06
# Smallest accepted thrust left for the torque, for rounding [m/s^2]
SPARE = -1e-2
# Relative tolerance of a control's limit, for rounding
CONTROL_SHARE = 1e-4
# Events that a faultless race does not have
FOUL = ("hit", "ground", "bounds", "timeout")


@dataclass
class Verified:
    """The findings of the check of a solution, which is valid if there are no faults."""

    # Largest gap between a node and the integrated end of the interval before it [m]
    residual: float = 0.0
    # Value of all residuals in time: the sum of |costate . residual| [s]
    worth: float = 0.0
    # Largest | |q| - 1 |
    attitude: float = 0.0
    # Largest body rates about x, y and z [rad/s]
    body_rate: tuple[float, float, float] = (0.0, 0.0, 0.0)
    # Events of the referee, if there is one
    outcome: str | None = None
    events: tuple[Event, ...] = ()
    # One line for each fault
    broken: list[str] = field(default_factory=list)

    def summary(self) -> Check:
        """Return the findings for storage, with the number of events of each kind."""
        return Check(
            residual=self.residual,
            worth=self.worth,
            attitude=self.attitude,
            body_rate=self.body_rate,
            outcome=self.outcome,
            events=dict(Counter(event.kind for event in self.events)),
            broken=tuple(self.broken),
        )


def verify(solution: Solution, model: Dynamics, referee: Referee | None = None) -> Verified:
    """Return the findings of the check of a solution.

    Args:
        solution: the optimiser's solution.
        model: the model of the solution.
        referee: new referee, see `referee_of`, which checks every step of the integration.
    """
    found = Verified()
    x = solution.x.tolist()
    t = solution.t.tolist()
    for k, u in enumerate(solution.u.tolist()):
        path = list(model.fine(tuple(x[k]), tuple(u), t[k + 1] - t[k]))

        # The gap at the node, in metres and in time
        residual = np.array(path[-1]) - solution.x[k + 1]
        found.residual = max(found.residual, float(np.linalg.norm(residual[POSITION])))
        found.worth += abs(float(solution.costate[k] @ residual))

        # The largest values in between
        found.attitude = max(found.attitude, *(abs(hypot(*p[ATTITUDE]) - 1.0) for p in path))
        rates = np.abs([found.body_rate, *(p[BODY_RATES] for p in path)])
        roll, pitch, yaw = rates.max(axis=0).tolist()
        found.body_rate = (roll, pitch, yaw)

        if referee:
            # The gap at the node belongs to the last step
            points = [p[POSITION] for p in (x[k], *path[:-1], x[k + 1])]
            times = np.linspace(t[k], t[k + 1], len(points)).tolist()
            for i in range(len(path)):
                before = tuple(points[i])
                after = tuple(points[i + 1])
                referee.observe(times[i], before, times[i + 1], after)
    if referee:
        found.outcome = referee.outcome
        found.events = tuple(referee.events)
    found.broken = [*_broken(found, solution), *_outside(found, solution, model)]
    if referee:
        found.broken += _incidents(referee)
    return found


def _broken(found: Verified, solution: Solution) -> Iterator[str]:
    """Yield a line for each way in which a solution violates the equations."""
    if found.residual > RESIDUAL:
        yield (
            f"nodes: expected at most {RESIDUAL:g} m from the finely integrated path, "
            f"got {found.residual:.2g}"
        )
    most = WORTH * solution.time
    if found.worth > most:
        yield f"nodes: expected residuals worth at most {most:.2g} s, got {found.worth:.2g}"
    if found.attitude > UNIT:
        yield (
            f"attitude: expected |q| = 1 within {UNIT:g}, got a difference of {found.attitude:.2g}"
        )


def _outside(found: Verified, solution: Solution, model: Dynamics) -> Iterator[str]:
    """Yield a line for each violated limit of the vehicle.

    Controls are checked at the nodes, up to rounding errors, and body rates at every step.
    """
    allowed = (1.0 + RATE_SHARE) * model.high[BODY_RATES] + RATE_MORE
    if (np.array(found.body_rate) > allowed).any():
        yield (
            f"body rates: expected at most {_rates_text(allowed)} rad/s, "
            f"got {_rates_text(found.body_rate)}"
        )
    tolerance = CONTROL_SHARE * np.maximum(np.abs(model.u_high), np.abs(model.u_low))
    below = solution.u < model.u_low - tolerance
    above = solution.u > model.u_high + tolerance
    if below.any() or above.any():
        yield "controls: expected all within the vehicle's limits, found one beyond"
    spare = []
    for x, u in zip(solution.x[:-1], solution.u, strict=True):
        spare += model.spare(tuple(x), tuple(u))
    if min(spare, default=0.0) < SPARE:
        yield f"thrust: expected room for the torque [m/s^2], got {min(spare):.2g}"


def _rates_text(rates: Any) -> str:
    return ", ".join(f"{rate:.3g}" for rate in rates)


def _incidents(referee: Referee) -> Iterator[str]:
    """Yield a line for each fault that the referee found."""
    for event in referee.events:
        if event.kind in FOUL:
            place = f" at {event.place}" if event.place else ""
            yield f"referee: {event.kind}{place}, t = {event.t:.3f} s"
    if referee.outcome != "finished":
        outcome = referee.outcome or "one that goes on"
        yield f"referee: expected a finished race, got {outcome}"
