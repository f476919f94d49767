"""Specs of stored flights: the record of a Spec, read back into a Spec that flies the same."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from math import isfinite
from pathlib import Path
from typing import Any, cast

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
from quadsim.config.settings import LINK, SETTINGS, FlightNumbers, HostSettings
from quadsim.config.spec import ALWAYS, Spec
from quadsim.controllers.costs.race import RaceWeights
from quadsim.controllers.costs.reference import ReferenceWeights
from quadsim.controllers.excitation import EXCITE
from quadsim.controllers.learned.pilot import Pilot, load_pilot
from quadsim.controllers.presets import Planner
from quadsim.controllers.samplers import SAMPLERS, Sampling
from quadsim.course import Course, parse_course
from quadsim.course.checks import problems
from quadsim.files.exact_json import exactly
from quadsim.files.strict_yaml import FileError
from quadsim.files.values import SettingError, checked
from quadsim.firmware.text import Text
from quadsim.racing.hand import HAND
from quadsim.record.run import canonical, hostless, own_parts
from quadsim.record.schema import FlownSpec, NumberChange

WHAT = "the record of a flight, such as run.spec"
# Settings that change no flight
HOST = tuple(f.name for f in fields(HostSettings))


class RecordError(FileError):
    """A recorded flight cannot be flown again. One line: which part of it, and what to do."""


class MissingPartError(RecordError):
    """A recorded flight needs a part of the user's own, which was not given.

    Attributes:
        role: the role of the part.
        what: the first part of the message, without what to do.
    """

    def __init__(self, role: str, how: str):
        """Describe a missing part.

        Args:
            role: its role.
            how: what to do.
        """
        self.role = role
        self.what = f"{role}: the flight had one of your own, whose code is not in the record"
        super().__init__(f"{self.what}; {how}")


def spec_of_record(record: Mapping[str, Any], runs_dir: str | None = None, **own: object) -> Spec:
    """Return the Spec of a recorded flight, which flies the same to the last bit.

    Files that the flight has followed (a pilot, a solution of `race limit`) are looked for in their
    recorded places, and have to be the same. A record has the names of the user's own parts and not
    their code: each is given anew, and has to be the same.

    Args:
        record: the spec of a run.
        runs_dir: folder of runs in place of the recorded one.
        own: {role: part} of the user's own parts that took part in the flight; `pilot`: the pilot,
            if its file is no longer in its place.

    Raises:
        RecordError: a file or a part is missing or differs, or the record is not one of a flight.

    Examples:
        >>> import quadsim
        >>> from quadsim.config.recorded import spec_of_record
        >>> run = quadsim.fly("figure8", laps=1, samples=256)
        >>> spec_of_record(run.spec).sampler
        'colored'
    """
    if "heat" in record:
        raise RecordError(
            "heat: the run flew among others; fly the race again with race heat --from its folder"
        )
    if HAND in record:
        raise RecordError("hand: a person flew the run, which cannot be flown again: replay it")
    try:
        read = exactly(dict(record), FlownSpec)
        _check_own(set(read.own), {role: own[role] for role in own.keys() - {"pilot"}})
        numbers = _numbers(record, read)
        folders = [runs_dir or read.host.runs_dir, read.host.runs_dir]
        spec = _built(read, numbers, own, list(dict.fromkeys(folders)))
    except msgspec.ValidationError as error:
        raise RecordError(f"expected {WHAT}: {error}") from None
    _check_same(record, spec)
    return spec


def recorded_spec(record: Mapping[str, Any], settings: Mapping[str, Any]) -> Spec:
    """Return the Spec of a recorded flight with some of its settings changed.

    Args:
        record: the spec of a run.
        settings: keywords of `quadsim.fly`. Those that give the user's own parts of the flight, the
            folder of runs and the threads change no flight; with any other, changes made in flight
            are not made again.

    Raises:
        RecordError: see `spec_of_record`.
        SettingError: see `Spec.but`.
    """
    given, changed = sorted_settings(record, settings)
    own = dict(given)
    runs_dir = own.pop("runs_dir", None)
    host = {name: own.pop(name) for name in HOST if name in own}
    term = own.pop("term", None)
    if term is not None:
        texts = [term] if isinstance(term, str) else term
        own["terms"] = tuple(map(term_of_text, texts))
    if "controller" in own:
        own["controller"] = _own_controller(own["controller"], record["own"]["controller"])
    if runs_dir is not None:
        runs_dir = str(checked("runs_dir", runs_dir, SETTINGS["runs_dir"].kind))
    # The pilot that flew may lie somewhere else by now
    pilot = changed.get("pilot")
    if isinstance(pilot, str | Path) and isinstance(record.get("pilot"), Mapping):
        pilot = load_pilot(pilot)
        if pilot.digest == record["pilot"].get("sha256"):
            own["pilot"] = pilot
            del changed["pilot"]
    spec = replace(spec_of_record(record, runs_dir, **own), **host)
    return spec.but(**changed) if changed else spec


def sorted_settings(
    record: Mapping[str, Any], settings: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the settings that a recorded flight needs anew, and those that change it."""
    described = record.get("own")
    needed = {*HOST, *(described if isinstance(described, Mapping) else ())}
    if "terms" in needed:
        needed.add("term")
    asked = {name: value for name, value in settings.items() if value is not None}
    given = {name: value for name, value in asked.items() if name in needed}
    changed = {name: value for name, value in asked.items() if name not in needed}
    return given, changed


def _check_own(described: set[str], own: Mapping[str, object]) -> None:
    """Raise RecordError unless the user's own parts are the parts that the record has."""
    for role in sorted(described - own.keys()):
        how = f"give it again as {role}=..."
        if role in ("sampler", "terms", "controller"):
            how += f", or --{role.removesuffix('s')}"
        if role == "course":
            # `quadsim.fly` takes the record in the course's place
            how = "fly spec_of_record(run.spec, course=...) of quadsim.config.recorded"
        raise MissingPartError(role, how)
    for role in sorted(own.keys() - described):
        raise RecordError(f"{role}: expected none, as the recorded flight had none of its own")


def _own_controller(given: object, described: object) -> object:
    """Return the controller that was given for a recorded one.

    A text names its class; the flight may have been given the class or an object of it.

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


def _numbers(record: Mapping[str, Any], read: FlownSpec) -> dict[str, Any]:
    """Return the settings of FlightNumbers as a record has them.

    Raises:
        RecordError: one that every record has is missing.
        msgspec.ValidationError: one is of another type or out of range.
    """
    for field in fields(FlightNumbers):
        if field.name in ALWAYS and field.name not in record:
            raise RecordError(f"expected {WHAT}: no `{field.name}`")
    numbers = vars(exactly(dict(record), FlightNumbers))
    # Those that a record has in another form
    link = {name: getattr(read.link, number) for name, number in LINK.items()}
    firmware = "betaflight" if read.betaflight else "ideal"
    return numbers | link | {"fault": read.faults, "flight_controller": firmware}


def _built(
    read: FlownSpec, numbers: dict[str, Any], own: Mapping[str, Any], folders: Sequence[str]
) -> Spec:
    """Return the Spec of a record that has been read.

    Args:
        read: the record.
        numbers: its settings of FlightNumbers.
        own: the user's own parts by role.
        folders: folders of runs in which to look for a solution that was followed; the first is
            the folder of the Spec.
    """
    course: Course = own.get("course") or parse_course(read.course_text, read.course)
    _check_ranges(read, course)
    planner = _planner(read, own)
    reference = None
    if read.reference and isinstance(planner.cost, ReferenceWeights):
        problem = followed_problem(course, read.vehicle, read.laps, planner.cost)
        reference = followed_reference(problem, read.reference.sha256, folders)
    return Spec(
        course=course,
        vehicle=read.vehicle,
        planner=planner,
        model=read.model,
        laps=read.laps,
        timeout=read.timeout,
        start=read.start,
        sensing=read.sensing,
        randomization=read.randomization,
        pilot=_pilot(read, own),
        view_weight=read.view_weight,
        plant=own.get("plant") or _plant(read.plant),
        betaflight=Text(read.betaflight.name, read.betaflight.lines) if read.betaflight else None,
        terms=terms_of(own["terms"]) if "terms" in own else (),
        cost=own.get("cost"),
        controller=own.get("controller"),
        referee=own.get("referee"),
        reference=reference,
        changes=_changes(read, planner),
        runs_dir=folders[0],
        **numbers,
    )


def _check_ranges(read: FlownSpec, course: Course) -> None:
    """Check the parts of a record that come from files by the rules of these files.

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


def _plant(name: str) -> Any:
    """Return the name of a plant. Raises RecordError."""
    if name not in PLANTS:
        known = " or ".join(map(repr, PLANTS))
        raise RecordError(f"plant: expected {known}, got {name!r}")
    return name


def _planner(read: FlownSpec, own: Mapping[str, Any]) -> Planner:
    """Return the planner of a record."""
    stored = read.planner
    if "sampler" in own:
        sampling = cast(Sampling, own_sampler(own["sampler"]))
    else:
        # A flight by a pilot has a planner too, which does not fly
        sampling = _sampling(read.sampler, stored.sampling)
    cost_class = ReferenceWeights if read.reference else RaceWeights
    return Planner(
        vehicle=stored.vehicle,
        sampling=sampling,
        mppi=stored.mppi,
        cost=exactly(stored.cost, cost_class),
        preset=read.preset,
    )


def _sampling(name: str, numbers: Any) -> Sampling:
    """Return a registered sampler with these numbers. Raises RecordError."""
    if not isinstance(numbers, dict):
        raise RecordError(f"sampler: expected the numbers of {name!r}, got {numbers!r:.40}")
    if name in ("pilot", EXCITE):
        # The planner does not fly: any sampler with these numbers will do
        names = [key for key, kind in SAMPLERS.items() if numbers.keys() <= _field_names(kind)]
        name = names[0] if names else name
    if name not in SAMPLERS:
        raise RecordError(f"sampler: expected one of {', '.join(SAMPLERS)}, got {name!r}")
    return exactly(numbers, SAMPLERS[name])


def _field_names(kind: type) -> set[str]:
    return {field.name for field in fields(kind)}


def _pilot(read: FlownSpec, own: Mapping[str, Any]) -> Pilot | None:
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


def _changes(read: FlownSpec, planner: Planner) -> tuple[NumberChange, ...]:
    """Return the changes that were made in flight, all of which can be made again.

    Raises:
        msgspec.ValidationError: one cannot.
    """
    for change in read.interactive:
        planner_after(change, planner)
    return tuple(read.interactive)


def _check_same(record: Mapping[str, Any], spec: Spec) -> None:
    """Raise RecordError unless a Spec has the record that it was made from.

    It may have more: settings that are younger than the record, which are at their defaults.
    """
    asked = hostless(dict(record))
    found = hostless(json.loads(canonical(spec.record())))
    for key, value in asked.items():
        if _has(found.get(key), value):
            continue
        if key == "own":
            _check_same_parts(value, found.get(key, {}))
        wanted = "expected what this version of quadsim flies with"
        raise RecordError(f"{key}: {wanted}, got another in the record: it cannot be flown again")


def _has(found: Any, asked: Any) -> bool:
    """Return whether a value has all that another one has."""
    if isinstance(asked, dict) and isinstance(found, dict):
        return all(name in found and _has(found[name], value) for name, value in asked.items())
    return found == asked


def _check_same_parts(asked: Mapping[str, Any], found: Mapping[str, Any]) -> None:
    """Raise RecordError with the first of the user's own parts that is not the recorded one."""
    for role, part in asked.items():
        if part == found.get(role):
            continue
        names = own_parts({"own": {role: part}})[role]
        got = "one that differs from it, or that a flight has changed since"
        raise RecordError(f"{role}: expected the {names} that flew, got {got}")
