"""`race check`: whether course, vehicle, preset and sensing files can be used."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Annotated, NamedTuple

import yaml
from rich.markup import escape
from rich.table import Table

from quadsim.cli.flags import Help, Json, names
from quadsim.config.presets import parse_planner
from quadsim.console import UsageError, complain, emit, emit_json, plain_table
from quadsim.course import COURSES, Course, course_names, load_course, parse_course
from quadsim.course.checks import looks_like_radians
from quadsim.course.course import in_degrees, summary
from quadsim.files.data_files import locate, read_text
from quadsim.files.strict_yaml import FileError, parse
from quadsim.files.yaml_errors import cut, did_you_mean
from quadsim.racing.fits import misfit
from quadsim.sensing.camera import Camera, camera_names
from quadsim.sensing.sensing_file import (
    SENSINGS,
    SENSORS,
    camera_named,
    parse_sensing,
    sensing_names,
)
from quadsim.sensing.whole_gates import gates_alike, whole_from
from quadsim.vehicle import (
    VEHICLES,
    load_vehicle,
    parse_vehicle,
    unlikely_inertia,
    vehicle_names,
)
from quadsim.vehicle.flying import flying_numbers

# Keys that identify the kind of a file
OF_VEHICLE = {"mass", "inertia", "rate_tau"}
OF_PRESET = {"base"}
OF_SENSING = {"exact", *SENSORS}
MOST_OTHERS = 19  # errors of a file that are printed besides the first


class Described(NamedTuple):
    """The kind of a file, a summary of its content, and what is allowed but looks wrong."""

    kind: str
    summary: str
    remark: str = ""


def check(
    *files: Annotated[str, Help("a course, vehicle, preset or sensing file, or the name of one")],
    camera: Annotated[
        str | None,
        Help(
            "also prints from which distance a course's gates are whole in the picture of a camera,"
            " a name or a FILE.yaml, or of the camera of a set of sensors; default: none",
            completer=names(lambda: (*camera_names(), *sensing_names())),
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Check course, vehicle, preset and sensing files; exit code 2 if any cannot be used.

    A course and a vehicle given together are checked to fit: the vehicle through the gates.

    race check mine.yaml

    race check mine.yaml kingfisher

    race check aigp_physical --camera aigp
    """
    if not files:
        raise UsageError("expected one FILE or more, got none")
    eyes = None if camera is None else camera_named(camera)
    results = with_fits([examine(name) for name in files])
    if eyes is not None:
        results = [_with_view(result, eyes) for result in results]
    if json:
        emit_json(results)
    else:
        for result in results:
            _print_result(result)
    return 0 if all(result["ok"] for result in results) else 2


def examine(name: str) -> dict:
    """Return file, ok, kind, summary and remark of a file; or file, ok, error, excerpt and others.

    `others` are the further errors of the file, each with its excerpt.
    """
    try:
        path = _find(name)
        found = describe(read_text(path), str(path))
    except FileError as error:
        return _wrong(name, error)
    return {"file": str(path), "ok": True, **found._asdict()}


def _with_view(result: dict, camera: Camera) -> dict:
    """Return the result of a course with `whole_from`, and any other result as it is.

    Args:
        result: result of `examine`.
        camera: the camera.
    """
    if result.get("kind") != "course":
        return result
    gates = load_course(result["file"]).gates
    views = [
        {"gates": numbers, "from": [view._asdict() for view in whole_from(gates[k - 1], camera)]}
        for numbers in gates_alike(gates)
        for k in numbers[:1]
    ]
    return result | {"whole_from": views}


def _view_table(views: Sequence[dict]) -> Table:
    """Return the distances from which gates are whole in the picture, as a table."""
    table = plain_table("gates", "nose down [deg]", "opening [m]", "with its frame [m]", left=[0])
    for view in views:
        name = _numbers_of(view["gates"])
        for row in view["from"]:
            ranges = (row["opening"], row["frame"])
            shown = ("never" if least is None else f"{least:.2f}" for least in ranges)
            table.add_row(name, f"{row['pitch']:g}", *shown)
            name = ""
    return table


def _numbers_of(numbers: Sequence[int]) -> str:
    """Return numbers in a row as "1 to 11", others as "1, 3"."""
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"{numbers[0]} to {numbers[-1]}"
    return ", ".join(map(str, numbers))


def _wrong(name: str, error: FileError) -> dict:
    """Return the result of a file with errors."""
    others = [{"error": str(other), "excerpt": other.excerpt} for other in error.others]
    wrong = {"error": str(error), "excerpt": error.excerpt}
    return {"file": name, "ok": False, **wrong, "others": others}


def with_fits(results: Sequence[dict]) -> list[dict]:
    """Return the results with an error for each course that a given vehicle cannot fly.

    Args:
        results: results of `examine`.
    """
    by_kind: dict[str, list[str]] = {"course": [], "vehicle": []}
    for result in results:
        if result.get("kind") in by_kind:
            by_kind[result["kind"]].append(result["file"])
    problems: dict[str, str] = {}
    for file, other in product(by_kind["course"], by_kind["vehicle"]):
        # a pipe can be read only once
        with suppress(FileError):
            problem = misfit(load_course(file), load_vehicle(other))
            if problem:
                problems.setdefault(file, f"{file}: for {other}: {problem}")
    checked = []
    for result in results:
        error = problems.get(result["file"])
        checked.append(_wrong(result["file"], FileError(error)) if error else result)
    return checked


def describe(text: str, file: str) -> Described:
    """Return the kind of a file, identified by a key, and a summary of its content.

    Args:
        text: text of the file.
        file: named in errors.

    Raises:
        FileError: the file cannot be used.
    """
    root = parse(text, file).root
    keys = set()
    if isinstance(root, yaml.MappingNode):
        keys = {key.value for key, _ in root.value if isinstance(key, yaml.ScalarNode)}
    if keys & OF_VEHICLE:
        vehicle = parse_vehicle(text, file)
        found = f"{vehicle.mass:g} kg, {flying_numbers(vehicle).text()}"
        return Described("vehicle", found, unlikely_inertia(vehicle))
    if keys & OF_PRESET:
        return _describe_preset(text, file)
    if keys & OF_SENSING:
        sensing = parse_sensing(text, file)
        given = [name for name in SENSORS if getattr(sensing, name)]
        return Described("sensing", ", ".join(given) or "the true state")
    course = parse_course(text, file)
    return Described("course", summary(course), _remark(course))


def _remark(course: Course) -> str:
    """Return what the checks allow in a course but looks wrong, "" if nothing does."""
    angles = [in_degrees(gate.yaw) for gate in course.gates]
    if not looks_like_radians(angles):
        return ""
    got = cut(", ".join(f"{angle:g}" for angle in angles))
    return f"yaw_deg of the gates looks like radians, expected degrees, got {got}"


def _describe_preset(text: str, file: str) -> Described:
    planner = parse_planner(text, file, "colored")
    try:
        load_vehicle(planner.vehicle)
    except FileError as error:
        raise parse(text, file).error("vehicle", str(error)) from None
    samples, horizon = planner.mppi.samples, planner.mppi.horizon
    return Described("preset", f"{samples} samples, horizon {horizon}")


def _find(name: str) -> Path:
    """Return the file of a course, vehicle or sensing by its name, or the path if one is given.

    Raises:
        FileError: the name is neither known nor a path.
    """
    known = dict.fromkeys(vehicle_names(), (VEHICLES, "vehicle"))
    known |= dict.fromkeys(sensing_names(), (SENSINGS, "sensing"))
    known |= dict.fromkeys(course_names(), (COURSES, "course"))
    if name in known:
        folder, kind = known[name]
        return locate(name, folder, kind)
    if Path(name).exists() or "." in name or "/" in name:
        return Path(name)
    raise FileError(
        f"{name}: no such file, course, vehicle or sensing: {did_you_mean(name, known)}"
    )


def _print_result(result: dict) -> None:
    if result["ok"]:
        emit(f"{escape(result['file'])}: [green]ok[/], {result['kind']}: {result['summary']}")
        if result["remark"]:
            complain(f"{result['file']}: {result['remark']}")
        if "whole_from" in result:
            emit("whole in the picture from a distance of", _view_table(result["whole_from"]))
        return
    for wrong in (result, *result["others"][:MOST_OTHERS]):
        complain(wrong["error"])
        if wrong["excerpt"]:
            complain(wrong["excerpt"])
    left = len(result["others"]) - MOST_OTHERS
    if left > 0:
        complain(f"{result['file']}: {left} more errors")
