"""A stored solution of `race limit` as what a planner follows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from controllers.costs.reference import Reference, ReferenceWeights
from quadsim.course import Course
from quadsim.files.strict_yaml import FileError
from quadsim.record.limits import LIMITS, LimitProblem, StoredSolution
from quadsim.vehicle import Vehicle


def stored_reference(
    course: Course, vehicle: Vehicle, laps: int, weights: ReferenceWeights
) -> StoredSolution:
    """The solution that comes with the project or lies in runs/limits. Raises FileError where there
    is none."""
    race = replace(
        LimitProblem(course, vehicle, laps, "rates"), margin=weights.margin, reserve=weights.reserve
    )
    found = race.best_known(Path("runs") / LIMITS)
    if found:
        return found
    name, _, ratio = vehicle.name.partition("-twr")
    flown = f"{name} --thrust-to-weight {ratio}" if ratio else name
    said = (
        f"{course.name} --vehicle {flown} --laps {laps} --model rates --margin {weights.margin:g}"
    )
    how = f"race limit {said} --reserve {weights.reserve:g}"
    raise FileError(
        f"preset: expected a stored solution of this race to follow, got none: search it with {how}"
    )


def reference_of(limit: StoredSolution, vehicle: Vehicle, dt: float) -> Reference:
    """Its states and controls at every control period dt [s]."""
    s = limit.solution
    t = np.arange(0.0, s.t[-1], dt)
    # the one around the period's middle
    interval = np.clip(np.searchsorted(s.t, t + dt / 2) - 1, 0, len(s.u) - 1)
    passes = [float(s.t[1:][s.target == k][-1]) for k in range(int(s.target.max()) + 1)]
    return Reference.of(
        limit.states(vehicle, t)[:, :6], s.u[interval], [round(at / dt) for at in passes], dt
    )
