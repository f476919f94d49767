"""Stored solutions of `race limit` as references that a planner follows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from shlex import quote
from types import MappingProxyType
from typing import Any

import numpy as np

from quadsim.controllers.costs.reference import Reference, ReferenceWeights
from quadsim.course import Course, load_course
from quadsim.files.strict_yaml import FileError
from quadsim.limit.limits import LimitProblem, StoredSolution, limits_folder
from quadsim.vehicle import Vehicle, vehicle_names


def followed_problem(
    course: Course, vehicle: Vehicle, laps: int, weights: ReferenceWeights
) -> LimitProblem:
    """Return the problem whose solution a planner with these weights follows."""
    problem = LimitProblem(course, vehicle, laps, "rates")
    return replace(problem, margin=weights.margin, reserve=weights.reserve)


def stored_reference(
    course: Course,
    vehicle: Vehicle,
    laps: int,
    weights: ReferenceWeights,
    runs_dir: str | Path,
    given: Mapping[str, Any] = MappingProxyType({}),
) -> StoredSolution:
    """Return the fastest known solution of a race that a planner may follow.

    Args:
        course, vehicle, laps: the race.
        weights: weights with the margin and the reserve of the solution to look for.
        runs_dir: folder of runs, which is searched in addition to the project's solutions.
        given: the settings from which course and vehicle were made, for the error's advice.

    Raises:
        FileError: there is no solution of this race.
    """
    problem = followed_problem(course, vehicle, laps, weights)
    stored = problem.best_known(limits_folder(runs_dir))
    if stored:
        return stored
    command = " ".join(
        [
            f"race limit {_course_argument(course, given)}",
            f"--vehicle {_vehicle_flags(vehicle, given)}",
            f"--laps {laps} --model rates",
            f"--margin {weights.margin:g} --reserve {weights.reserve:g}",
        ]
    )
    if str(runs_dir) != "runs":
        command += f" --runs-dir {quote(str(runs_dir))}"
    message = "preset: expected a stored solution of this race to follow, got none"
    raise FileError(f"{message}: search for one with {command}")


def _course_argument(course: Course, given: Mapping[str, Any]) -> str:
    """Return the argument of a command that selects the course.

    Args:
        course: the course.
        given: the settings from which it was made.
    """
    name = given.get("course")
    if isinstance(name, str | Path):
        return quote(str(name))
    with suppress(FileError):
        if load_course(course.name).text == course.text:
            return course.name
    return f"{course.name}.yaml"


def _vehicle_flags(vehicle: Vehicle, given: Mapping[str, Any]) -> str:
    """Return the values of flags that select the vehicle and its thrust.

    Args:
        vehicle: the vehicle.
        given: the settings from which it was made.
    """
    named, _, ratio = vehicle.name.partition("-twr")
    name = given.get("vehicle")
    if not isinstance(name, str | Path):
        name = named if named in vehicle_names() else f"{named}.yaml"
    thrust = f" --thrust-to-weight {ratio}" if ratio else ""
    return quote(str(name)) + thrust


def followed_reference(
    problem: LimitProblem, digest: str, folders: Sequence[str | Path]
) -> StoredSolution:
    """Return the solution that a recorded flight has followed.

    Args:
        problem: problem that the solution solves.
        digest: sha256 of the solution's content, as in StoredSolution.
        folders: folders of runs, which are searched in addition to the project's solutions.

    Raises:
        FileError: the solution does not exist any more.
    """
    files = problem.files(*map(limits_folder, folders))
    for path in files:
        solution = problem.read(path)
        if solution.digest == digest:
            return solution
    others = f"{len(files)} of other content" if files else "none"
    wanted = f"the solution that was followed, with sha256 {digest[:12]}..."
    raise FileError(
        f"{limits_folder(folders[0])}/{problem.file_name}: expected {wanted}, got {others}"
    )


def reference_of(limit: StoredSolution, vehicle: Vehicle, dt: float) -> Reference:
    """Return a solution's states and controls at every control period.

    Args:
        limit: the solution.
        vehicle: vehicle that the solution was computed for.
        dt: control period [s].
    """
    solution = limit.solution
    t = np.arange(0.0, solution.t[-1], dt)

    # A period takes the control of that interval of the solution in which its middle lies.
    middle = np.searchsorted(solution.t, t + dt / 2) - 1
    interval = np.clip(middle, 0, len(solution.u) - 1)

    # A gate is passed at the end of the last interval that aims at it.
    gates = range(int(solution.target.max()) + 1)
    passes = [float(solution.t[1:][solution.target == gate][-1]) for gate in gates]
    rows = [round(t_pass / dt) for t_pass in passes]
    return Reference.of(limit.states(vehicle, t)[:, :6], solution.u[interval], rows, dt)
