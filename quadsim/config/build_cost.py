"""Build the cost of a Spec: the racing or the reference cost, with the user's own terms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from quadsim.config.build_plant import start_of, system_of
from quadsim.config.own import called
from quadsim.config.reference import reference_of
from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
from quadsim.controllers.costs import Cost
from quadsim.controllers.costs.race import RaceWeights, map_value, margin_of, race_cost
from quadsim.controllers.costs.race_caution import Sight, unseen_gates
from quadsim.controllers.costs.race_view import with_view
from quadsim.controllers.costs.reference import ReferenceWeights, reference_cost
from quadsim.course import Course
from quadsim.files.yaml_errors import shown_value
from quadsim.value import CourseValue, PointMass

if TYPE_CHECKING:
    pass


def cost_on(spec: Spec, course: Course) -> Cost:
    """Return the planner's cost on this course, followed by the user's own terms.

    Raises:
        SettingError: the user's cost is not a cost, or two terms have the same name (a ValueError).
    """
    if isinstance(spec.cost, Cost):
        cost = spec.cost
    elif spec.cost is None:
        cost = race_cost_on(spec, course)
    else:
        cost = changed_cost(spec.cost, race_cost_on(spec, course))
    if not spec.terms:
        return cost
    try:
        return replace(cost, terms=(*cost.terms, *spec.terms))
    except ValueError as error:
        raise SettingError("terms", str(error)) from None


def changed_cost(change: Callable[[Cost], object], cost: Cost) -> Cost:
    """Return the result of the user's function that changes the default cost.

    Raises:
        SettingError: the function does not return a Cost, or returns an inconsistent one.
    """
    try:
        found = called("cost", change, "the default Cost", cost)
    except SettingError:  # it names itself
        raise
    except ValueError as error:  # a Cost whose fields do not fit together
        raise SettingError("cost", one_line(error)) from None
    if not isinstance(found, Cost):
        wanted = f"expected {shown_value(change)} to return a Cost"
        missing = ": is a return missing?" if found is None else ""
        raise SettingError("cost", f"{wanted}, got {shown_value(found)}{missing}")
    return found


def one_line(error: Exception) -> str:
    """Return the text of an error on one line."""
    return " ".join(str(error).split())


def race_cost_on(spec: Spec, course: Course) -> Cost:
    """Return the racing or reference cost on this course, with the planner's weights.

    With a camera and a view_weight, a term keeps the nose in the direction of flight.
    """
    weights = spec.planner.cost
    radius = spec.vehicle.radius
    if isinstance(weights, ReferenceWeights):
        if spec.reference is None:
            raise SettingError("reference", "expected the solution that this preset follows")
        reference = reference_of(spec.reference, spec.vehicle, spec.planner.mppi.dt)
        return reference_cost(course, radius, weights, reference)
    sight = sight_of(spec, weights, course)
    value = value_of(spec, weights)
    cost = race_cost(course, radius, weights, spec.laps, sight, value)
    if spec.sensing and spec.sensing.corner_camera and spec.view_weight:
        return with_view(cost, spec.view_weight)
    return cost


def value_of(spec: Spec, weights: RaceWeights) -> CourseValue | None:
    """Return the value of the planner's map; None without the term `time_to_go`."""
    if not weights.time_to_go:
        return None
    mass = PointMass.of(spec.vehicle)
    margin = margin_of(weights)
    return map_value(spec.course, spec.vehicle.radius, margin, spec.laps, mass)


def sight_of(spec: Spec, weights: RaceWeights, known: Course) -> Sight | None:
    """Return the distance from which displaced gates are known, None if caution has no use.

    Args:
        spec: specification of the flight.
        weights: the planner's weights.
        known: the course that is known at present.
    """
    displacement = spec.displacement
    if spec.known_from is None or not displacement.gates or not weights.caution:
        return None
    return Sight(
        unseen=unseen_gates(spec.course, known),
        known_from=spec.known_from,
        aside=displacement.gates,
        height=displacement.height,
        model=spec.model,
        period=spec.planner.mppi.dt,
    )


def check_cost(spec: Spec, cost: Cost) -> None:
    """Check that a cost with the user's own parts can be compiled. Raises SettingError."""
    from quadsim.controllers.lanes.planner_loops import module_source
    from quadsim.controllers.lanes.trace import TraceError

    try:
        module_source(system_of(spec), cost, np.float32)
        _check_rows(spec, cost)
    except SettingError:
        raise
    except (TraceError, ValueError) as error:
        raise SettingError("terms" if spec.terms else "cost", one_line(error)) from None


def _check_rows(spec: Spec, cost: Cost) -> None:
    """Check the numbers of a cost at the start, by the functions that the planner calls.

    Raises:
        ValueError: weights, targets or the guide have another shape, or are not finite.
    """
    horizon = spec.planner.mppi.horizon
    cost.numbers(len(spec.planner.mppi.step_lengths))
    if cost.obstacles:
        _ = cost.crash_term
    x = np.array(start_of(spec))
    rows = cost.targets_from(0, x)
    if not len(rows) or not np.isfinite(rows).all():
        raise ValueError(f"cost {cost.name}: expected finite targets from the start on, got none")
    if cost.guide:
        shape = (horizon, len(system_of(spec).rest))
        guide = called("cost", cost.guide, "a target, a state and a horizon", 0, x, horizon)
        if np.shape(guide) != shape or not np.isfinite(np.asarray(guide, float)).all():
            wanted = f"expected finite controls of shape {shape}"
            raise ValueError(f"cost {cost.name}: guide: {wanted}, got {shown_value(guide)}")
