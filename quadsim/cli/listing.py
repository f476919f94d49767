"""Lists of courses, vehicles, settings and so on (`race courses` ...)."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from rich.console import RenderableType

from quadsim.cli.flags import Help, Json
from quadsim.config.competition import competition_names, load_competition
from quadsim.console import UsageError, emit, emit_json, width
from quadsim.controllers.presets import PRESETS
from quadsim.course import course_names, load_course
from quadsim.files.atomic import replace_file
from quadsim.record.whole_files import expect_writable
from quadsim.sensing.sensing_file import (
    load_sensing,
    sensing_names,
)
from quadsim.tables.listings import (
    SAMPLER,
    competition_table,
    course_table,
    preset_table,
    sensing_table,
    setting_table,
    vehicle_table,
)
from quadsim.tables.settings_table import setting_rows
from quadsim.vehicle import (
    load_vehicle,
    vehicle_names,
)

RANDOM_COURSES = "random_courses"


def courses(
    *,
    generate: Annotated[
        Annotated[int, Meta(ge=1, le=10_000)] | None, Help("number of random courses to write")
    ] = None,
    seed: Annotated[
        Annotated[int, Meta(ge=0, le=10**9)] | None,
        Help("random seed of the generated courses; default: 0"),
    ] = None,
    out: Annotated[
        str | None, Help(f"folder for the generated courses; default: {RANDOM_COURSES}")
    ] = None,
    json: Json = False,
) -> int:
    """List the courses that come with the project, or generate random ones.

    `race fly FILE.yaml` flies any other course.

    race courses --generate 10 --seed 1 --out random_courses
    """
    if generate is not None:
        return _generate(generate, seed or 0, Path(out or RANDOM_COURSES), json)
    for flag, given in (("--seed", seed), ("--out", out)):
        if given is not None:
            raise UsageError(f"{flag}: expected --generate N with it, got it alone")
    known = [load_course(name) for name in course_names()]
    found = [asdict(course) | {"lap_length": course.lap_length} for course in known]
    return _listed(json, found, course_table(known, width()))


def vehicles(*, json: Json = False) -> int:
    """List the vehicles that come with the project.

    `race fly --vehicle FILE.yaml` flies any other vehicle.
    """
    known = [load_vehicle(name) for name in vehicle_names()]
    found = [asdict(v) | {"thrust_to_weight": v.thrust_to_weight} for v in known]
    return _listed(json, found, vehicle_table(known))


def sensings(*, json: Json = False) -> int:
    """List the sets of sensors that come with the project.

    `race fly --sensing FILE.yaml` flies with any other set.
    """
    known = [load_sensing(name) for name in sensing_names()]
    return _listed(json, list(map(asdict, known)), sensing_table(known))


def competitions(*, json: Json = False) -> int:
    """List the competitions that come with the project.

    `race fly --competition FILE.yaml` flies in any other one.
    """
    known = [load_competition(name) for name in competition_names()]
    return _listed(json, list(map(asdict, known)), competition_table(known))


def presets(*, json: Json = False) -> int:
    """List the presets, with some of their numbers for colored sampling.

    Numbers of `race` follow from vehicle, course and control period; the table has those of its
    reference. `race show RUN --numbers` prints those that a run flew with, and their laws.

    `race fly --preset FILE.yaml` flies with any other preset.
    """
    found = {name: asdict(planners[SAMPLER].mppi) for name, planners in PRESETS.items()}
    return _listed(json, found, preset_table())


def settings(*, json: Json = False) -> int:
    """List all settings of a flight: unit, range, default and meaning.

    Each is a flag of `race fly`, and a keyword of `quadsim.fly`.
    """
    return _listed(json, [row._asdict() for row in setting_rows()], setting_table())


def _listed(as_json: bool, found: object, table: RenderableType) -> int:
    """Print a list, as one JSON value or as a table, and return the exit code."""
    if as_json:
        emit_json(found)
    else:
        emit(table)
    return 0


def _generate(number: int, seed: int, folder: Path, json: bool) -> int:
    from quadsim.course.random_courses import random_courses

    made = random_courses(number, seed)
    expect_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{course.name}.yaml" for course in made]
    for file, course in zip(files, made, strict=True):
        replace_file(file, course.text.encode())
    if json:
        emit_json([str(file) for file in files])
        return 0
    for file, course in zip(files, made, strict=True):
        emit(f"{file}: {len(course.gates)} gates, {course.lap_length:.0f} m")
    return 0
