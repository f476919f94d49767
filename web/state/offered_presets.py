"""The presets that a page offers for a race: all presets that can fly the race."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from functools import lru_cache

from quadsim.config.reference import followed_problem
from quadsim.config.settings import FlightSettings
from quadsim.controllers.costs.reference import ReferenceWeights
from quadsim.controllers.presets import PRESETS
from quadsim.course import Course
from quadsim.limit.limits import LimitProblem, limits_folder
from quadsim.vehicle import load_vehicle


def offered_presets(
    names: Iterable[str],
    chosen: Collection[str],
    course: Course,
    vehicle: str,
    laps: int,
    runs_dir: str,
) -> tuple[str, ...]:
    """Return the presets that can fly a race, and the presently chosen ones.

    A preset that follows a solution of `race limit` needs one of this course, vehicle and number of
    laps.

    Args:
        names: presets to choose from, each of PRESETS.
        chosen: presently chosen presets, which stay in the list; the page says what they lack.
        course, vehicle, laps: the race.
        runs_dir: folder of runs with solutions, in addition to the project's solutions.
    """
    return tuple(
        name for name in names if name in chosen or _can_fly(name, course, vehicle, laps, runs_dir)
    )


def _can_fly(preset: str, course: Course, vehicle: str, laps: int, runs_dir: str) -> bool:
    """Return whether a preset needs no solution, or a solution of this race is stored."""
    weights = PRESETS[preset][FlightSettings.sampler].cost
    if not isinstance(weights, ReferenceWeights):
        return True
    problem = _problem(weights, course, vehicle, laps)
    return bool(problem.files(limits_folder(runs_dir)))


# Cached, as a page calls this once a second and the problem's name is a hash of course and vehicle.
@lru_cache(maxsize=16)
def _problem(weights: ReferenceWeights, course: Course, vehicle: str, laps: int) -> LimitProblem:
    """Return the race whose solution a preset follows."""
    return followed_problem(course, load_vehicle(vehicle), laps, weights)
