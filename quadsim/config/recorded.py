"""Read the record of a flight into the fields of the Spec that repeats it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple, cast

import msgspec

from quadsim.config.changes import planner_after
from quadsim.config.checks import PLANTS, check_numbers
from quadsim.config.own import (
    describe,
    own_controller,
    own_sampler,
    term_of_text,
    terms_of,
)
from quadsim.config.reference import followed_problem, followed_reference
from quadsim.config.settings import SETTINGS, FlightNumbers, HostSettings
from quadsim.controllers.costs.race import RaceWeights
from quadsim.controllers.costs.reference import ReferenceWeights
from quadsim.controllers.excitation import EXCITE
from quadsim.controllers.learned.pilot import Pilot, load_pilot
from quadsim.controllers.presets import Planner
from quadsim.controllers.samplers import SAMPLERS, Sampling
from quadsim.course import Course
from quadsim.course.checks import problems
from quadsim.files.strict_yaml import FileError
from quadsim.files.values import SettingError, checked
from quadsim.firmware.text import Text
from quadsim.limit.limits import StoredSolution
from quadsim.racing.hand import HAND
from quadsim.record.run import canonical, hostless, own_parts
from quadsim.record.schema import RunSpec

WHAT = "the record of a flight, such as run.spec"
# Settings that change no flight
HOST = tuple(f.name for f in fields(HostSettings))


class RecordError(FileError):
    """An error of a recorded flight that cannot be repeated: the part and the remedy."""


class MissingPartError(RecordError):
    """An error of a recorded flight that needs one of the user's own parts.

    Attributes:
        role: the role of the part.
        what: the first part of the message, without the remedy.
    """

    def __init__(self, role: str, how: str):
        """Describe a missing part.

        Args:
            role: role of the part.
            how: the remedy.
        """
        self.role = role
        self.what = f"{role}: the flight had one of your own, whose code is not in the record"
        super().__init__(f"{self.what}; {how}")


# The settings beside a record


class Beside(NamedTuple):
    """The settings that are given in addition to the record of a flight."""

    # the user's own parts of the flight by role, and its pilot if its file has moved
    parts: dict[str, Any]
    # settings of HostSettings
    host: dict[str, Any]
    # settings that make it another flight
    changed: dict[str, Any]


def sorted_settings(record: Mapping[str, Any], settings: Mapping[str, Any]) -> Beside:
    """Return the settings that are given in addition to a record, sorted by their effect.

    Args:
        record: the spec of a run.
        settings: keywords of `quadsim.fly`; None: no settings.

    Raises:
        SettingError: a part or a setting of the host is invalid.
        FileError: the file of a pilot cannot be read.
    """
    described = record.get("own")
    if not isinstance(described, Mapping):
        described = {}
    asked = {name: value for name, value in settings.items() if value is not None}
    parts, host, changed = {}, {}, {}
    for name, value in asked.items():
        role = "terms" if name == "term" else name
        if name in HOST:
            host[name] = checked(name, value, SETTINGS[name].kind)
        elif role in described:
            parts[role] = _own_part(name, value, described[role])
        elif name == "pilot" and _is_pilot_of(record, pilot := _pilot_of(value)):
            parts[name] = pilot
        else:
            changed[name] = value
    return Beside(parts, host, changed)


def _own_part(name: str, given: Any, described: object) -> object:
    """Return the user's own part, such as a sampler, that replaces the recorded one.

    A record describes own parts but lacks their code, so the user passes them again.

    Args:
        name: the keyword of the part.
        given: the part, or a text that names it.
        described: the record's description of the part.

    Raises:
        SettingError: the given value is not a part of this kind.
    """
    if name == "term":
        texts = [given] if isinstance(given, str) else given
        return tuple(map(term_of_text, texts))
    if name == "terms":
        return terms_of(given)
    if name == "sampler":
        return own_sampler(given)
    if name == "controller":
        return _own_controller(given, described)
    return given


def _own_controller(given: object, described: object) -> object:
    """Return the controller that is given for a recorded one.

    A text names the class of the controller; the recorded flight may have used this class or an
    object of it.

    Raises:
        SettingError: there is no such controller.
    """
    found = own_controller(given)
    if not isinstance(given, str) or not isinstance(found, type) or describe(found) == described:
        return found
    try:
        one = found()
    except TypeError:  # it needs arguments, which only the user's own program knows
        return found
    return one if describe(one) == described else found


def _pilot_of(given: object) -> object:
    """Return the pilot of a name or a file, and other values unchanged. Raises FileError."""
    return load_pilot(given) if isinstance(given, str | Path) else given


def _is_pilot_of(record: Mapping[str, Any], pilot: object) -> bool:
    """Return whether a pilot equals the pilot of a recorded flight."""
    described = record.get("pilot")
    return (
        isinstance(pilot, Pilot)
        and isinstance(described, Mapping)
        and pilot.digest == described.get("sha256")
    )


# The fields of the Spec


def spec_fields(record: Mapping[str, Any], beside: Beside) -> dict[str, Any]:
    """Return the fields of the Spec of a recorded flight.

    Args:
        record: the spec of a run.
        beside: the settings that are given in addition; `changed` is not used.

    Raises:
        RecordError: a file or a part is missing or differs, or the record is not one of a flight.
    """
    if "heat" in record:
        raise RecordError(
            "heat: the run flew among others; fly the race again with race heat --from its folder"
        )
    if record.get(HAND):
        raise RecordError("hand: a person flew the run, which cannot be flown again: replay it")
    try:
        read = msgspec.convert(dict(record), RunSpec)
        numbers = msgspec.convert(dict(record), FlightNumbers)
        _check_roles(set(read.own), beside.parts.keys() - {"pilot"})
        return vars(numbers) | _parts(read, beside) | beside.host
    except msgspec.ValidationError as error:
        raise RecordError(f"expected {WHAT}: {error}") from None


def _check_roles(described: set[str], given: set[str]) -> None:
    """Check that the user's own parts are given for the roles that the record has.

    Raises:
        RecordError: a part is missing.
    """
    for role in sorted(described - given):
        how = f"give it again as {role}=..."
        if role in ("sampler", "terms", "controller"):
            how += f", or --{role.removesuffix('s')}"
        if role == "course":
            # `quadsim.fly` takes the record in the course's place
            how = "fly quadsim.Spec.of_record(run.spec, course=...)"
        raise MissingPartError(role, how)


def _parts(read: RunSpec, beside: Beside) -> dict[str, Any]:
    """Return the parts of a flight, and the settings that a Spec stores beside its parts."""
    own = beside.parts
    course: Course = own.get("course") or read.course.course()
    _check_ranges(read, course)
    planner = _planner(read, own)
    firmware = read.betaflight
    for change in read.interactive:
        planner_after(change, planner)  # raises if the change cannot be made again
    # The folder that is given now may hold the solution that the recorded one held
    runs_dir = beside.host.get("runs_dir", read.host.runs_dir)
    folders = list(dict.fromkeys([runs_dir, read.host.runs_dir]))
    return {
        "course": course,
        "vehicle": read.vehicle,
        "planner": planner,
        "model": read.model,
        "laps": read.laps,
        "timeout": read.timeout,
        "start": read.start,
        "sensing": read.sensing,
        "randomization": read.randomization,
        "pilot": _pilot(read, own),
        "view_weight": read.view_weight,
        "plant": own.get("plant") or _plant(read.plant),
        "betaflight": Text(firmware.name, firmware.lines) if firmware else None,
        "terms": own.get("terms", ()),
        "cost": own.get("cost"),
        "controller": own.get("controller"),
        "referee": own.get("referee"),
        "reference": _reference(read, course, planner, folders),
        "changes": tuple(read.interactive),
        "runs_dir": runs_dir,
    }


def _check_ranges(read: RunSpec, course: Course) -> None:
    """Check the parts of a record by the rules of the files that they come from.

    Raises:
        RecordError: a number is out of range.
    """
    try:
        check_numbers("vehicle", read.vehicle)
        check_numbers("sensing", read.sensing)
        check_numbers("randomization", read.randomization)
    except SettingError as error:
        raise RecordError(str(error)) from None
    if read.start is not None:
        numbers = (*read.start.position, read.start.yaw)
        fault = next(problems(replace(course, start=read.start)), None)
        if fault is not None or not all(map(isfinite, numbers)):
            raise RecordError(f"start: {fault.problem if fault else 'expected finite numbers'}")


def _plant(name: str) -> str:
    """Return the name of a plant. Raises RecordError."""
    if name not in PLANTS:
        known = " or ".join(map(repr, PLANTS))
        raise RecordError(f"plant: expected {known}, got {name!r}")
    return name


def _planner(read: RunSpec, own: Mapping[str, Any]) -> Planner:
    """Return the planner of a record."""
    stored = read.planner
    # A flight by a pilot has a planner too, which does not fly
    sampling = own.get("sampler") or _sampling(read.sampler, stored.sampling)
    cost_class = ReferenceWeights if read.reference else RaceWeights
    return Planner(
        vehicle=stored.vehicle,
        sampling=cast(Sampling, sampling),
        mppi=stored.mppi,
        cost=msgspec.convert(stored.cost, cost_class),
        preset=read.preset,
    )


def _sampling(name: str, numbers: Any) -> Sampling:
    """Return a registered sampler with given numbers. Raises RecordError."""
    if not isinstance(numbers, dict):
        raise RecordError(f"sampler: expected the numbers of {name!r}, got {numbers!r:.40}")
    if name in ("pilot", EXCITE):
        # The planner does not fly: any sampler with these numbers will do
        names = [key for key, kind in SAMPLERS.items() if numbers.keys() <= _field_names(kind)]
        name = names[0] if names else name
    if name not in SAMPLERS:
        raise RecordError(f"sampler: expected one of {', '.join(SAMPLERS)}, got {name!r}")
    return msgspec.convert(numbers, SAMPLERS[name])


def _field_names(kind: type) -> set[str]:
    return {field.name for field in fields(kind)}


def _pilot(read: RunSpec, own: Mapping[str, Any]) -> Pilot | None:
    """Return the pilot of a record: the given one, or the pilot of its file. Raises FileError."""
    if read.pilot is None:
        return None
    path = read.host.pilot or read.pilot.name
    pilot = own.get("pilot") or load_pilot(path)
    if pilot.digest != read.pilot.sha256:
        wanted = f"expected the pilot that flew, sha256 {read.pilot.sha256[:12]}..."
        raise RecordError(f"{path}: {wanted}, got {pilot.digest[:12]}...: the file has changed")
    # A copy of the file may have another name, which is part of the record
    return replace(pilot, name=read.pilot.name)


def _reference(
    read: RunSpec, course: Course, planner: Planner, folders: Sequence[str]
) -> StoredSolution | None:
    """Return the solution that the planner followed. Raises FileError."""
    if not (read.reference and isinstance(planner.cost, ReferenceWeights)):
        return None
    problem = followed_problem(course, read.vehicle, read.laps, planner.cost)
    return followed_reference(problem, read.reference.sha256, folders)


# The comparison that makes sure of it


def check_same(record: Mapping[str, Any], found: Mapping[str, Any]) -> None:
    """Check that a Spec's record equals the record that it was made from.

    Args:
        record: the spec of a run.
        found: the record of the Spec.

    Raises:
        RecordError: a key differs; the message has the first one.
    """
    asked = json.loads(canonical(hostless(dict(record))))
    found = json.loads(canonical(hostless(dict(found))))
    for key in sorted(asked.keys() | found.keys()):
        if key in asked and key in found and asked[key] == found[key]:
            continue
        if key == "own":
            _check_same_parts(asked.get(key, {}), found[key])
        wanted = "expected what this version of quadsim flies with"
        got = "another" if key in asked else "none"
        raise RecordError(f"{key}: {wanted}, got {got} in the record: it cannot be flown again")


def _check_same_parts(asked: Mapping[str, Any], found: Mapping[str, Any]) -> None:
    """Raise RecordError for the first own part that differs from the recorded one."""
    for role, part in asked.items():
        if part == found.get(role):
            continue
        names = own_parts({"own": {role: part}})[role]
        got = "one that differs from it, or that a flight has changed since"
        raise RecordError(f"{role}: expected the {names} that flew, got {got}")
