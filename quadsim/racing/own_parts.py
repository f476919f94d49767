"""Checks of the return values of a user's own controller and referee in a flight.

They take some microseconds per control period; a plan takes milliseconds.
"""

from __future__ import annotations

from math import isfinite
from numbers import Real

import numpy as np

from quadsim.controllers.plan import PlanStats
from quadsim.files.values import SettingError
from quadsim.files.yaml_errors import shown_value
from quadsim.racing.events import Event

# The outcomes that a referee may give.
OUTCOMES = ("finished", "crashed", "stuck", "timeout")
# Largest number of a control; beyond it the vehicle's equations overflow.
LARGEST = 1e9
# Largest count of a referee
MOST = 10**9
# A physics step may differ from the plant's dt by this share of it.
UNEVEN = 0.5


def checked_control(part: object, given: object, controls: int | None, member: str) -> np.ndarray:
    """Return a control as an array of float  (n_u,).

    Args:
        part: the controller.
        given: the returned value.
        controls: n_u; None: any number of controls.
        member: name of the controller's method or attribute.

    Raises:
        SettingError: the value is not n_u finite numbers.
    """
    try:
        u = np.asarray(given)
    except ValueError:  # lists of different lengths
        u = np.array(None)
    is_row = u.dtype.kind in "fiu" and u.ndim == 1
    # A number that is not finite fails this comparison too.
    if is_row and controls in (None, len(u)) and (abs(u) <= LARGEST).all():
        return u.astype(float, copy=False)
    count = "" if controls is None else f"{controls} "
    place = f"{type(part).__name__}.{member}"
    wanted = f"expected a control of {count}numbers within +-{LARGEST:g}"
    raise SettingError("controller", f"{place}: {wanted}, got {shown_value(given)}")


def checked_plan(
    part: object, answer: object, controls: int
) -> tuple[tuple[float, ...], PlanStats]:
    """Return the control and the statistics from a controller's returned value.

    Args:
        part: the controller.
        answer: value returned by its `control`.
        controls: n_u.

    Raises:
        SettingError: the value is not a control of n_u finite numbers with its PlanStats.
    """
    match answer:
        case (u, PlanStats() as stats):
            numbers = (stats.cost, stats.ess, stats.temperature)
            if all(isinstance(number, float | Real) for number in numbers):
                # An array of float, as the planner returns it, is checked without NumPy's overhead.
                if isinstance(u, np.ndarray) and u.dtype == float and u.shape == (controls,):
                    row = tuple(u.tolist())
                    if all(-LARGEST <= number <= LARGEST for number in row):
                        return row, stats
                return tuple(checked_control(part, u, controls, "control").tolist()), stats
    place = f"{type(part).__name__}.control"
    wanted = "expected a control and its PlanStats of three numbers"
    raise SettingError("controller", f"{place}: {wanted}, got {shown_value(answer)}")


def check_counts(referee: object) -> None:
    """Check the outcome and the counts of a referee.

    Raises:
        SettingError: one of them is missing, of another type or unknown.
    """
    for name in ("passed", "lap", "next_gate"):
        number = getattr(referee, name, None)
        if not isinstance(number, int | np.integer) or not 0 <= number <= MOST:
            problem = f"expected a whole number of 0 to {MOST:g}, got {shown_value(number)}"
            raise SettingError("referee", f"{type(referee).__name__}.{name}: {problem}")
    outcome = getattr(referee, "outcome", "")
    if not (outcome is None or (isinstance(outcome, str) and outcome in OUTCOMES)):
        wanted = f"expected None or one of {', '.join(OUTCOMES)}"
        problem = f"{type(referee).__name__}.outcome: {wanted}, got {shown_value(outcome)}"
        raise SettingError("referee", problem)


def checked_events(referee: object, found: object) -> list[Event]:
    """Return the events of a physics step. Raises SettingError unless they are a list of Events."""
    if isinstance(found, list) and all(isinstance(event, Event) for event in found):
        return found
    problem = f"expected a list of events, got {shown_value(found)}"
    raise SettingError("referee", f"{type(referee).__name__}.observe: {problem}")


def check_step(plant: object, before: float, after: float, dt: float) -> None:
    """Check that a physics step takes dt, so that every flight ends.

    Args:
        plant: the plant.
        before, after: times of its states before and after the step [s].
        dt: the plant's step [s].

    Raises:
        SettingError: the step is shorter or longer than dt.
    """
    if not abs(after - before - dt) <= UNEVEN * dt:
        wanted = f"expected a state {dt:g} s after t = {before:g}"
        raise SettingError("plant", f"{_plant_name(plant)}.step: {wanted}, got t = {after!r}")


def check_time(plant: object, before: float, now: float) -> None:
    """Check that a plant's `state` has moved on. Raises SettingError."""
    if not (isfinite(now) and now > before):
        wanted = f"expected the state after the last step, later than t = {before:g}"
        raise SettingError("plant", f"{_plant_name(plant)}.state: {wanted}, got t = {now!r}")


def _plant_name(plant: object) -> str:
    """Return the name of a plant's class; for a NamedPlant, of the user's class."""
    return getattr(plant, "name", type(plant).__name__)
