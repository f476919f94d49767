"""Describe the numbers in which a recorded planner differs from its preset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

import msgspec

from quadsim.controllers.derived import DERIVED, DerivedNumber, Scale, derivation, derived
from quadsim.controllers.presets import PRESETS, Planner, with_period
from quadsim.controllers.samplers import SAMPLERS
from quadsim.course import Course, parse_course
from quadsim.files.strict_yaml import FileError
from quadsim.physics.domain_randomization import Displacement
from quadsim.record.schema import RunSpec

# Numbers that are shown, at most
MOST = 4


def preset_changes(spec: dict[str, Any]) -> str:
    """Return the numbers that differ from the preset, such as "samples 256, horizon 60".

    It is "" if no number differs, or if the preset is a file or does not exist in this version.

    Args:
        spec: the record of a Spec, see Spec.record.
    """
    found = [f"{name} {value}" for name, value in changed_numbers(spec).items()]
    shown = found[:MOST]
    if len(found) > MOST:
        shown.append(f"and {len(found) - MOST} more")
    return ", ".join(shown)


def changed_numbers(spec: Mapping[str, Any]) -> dict[str, str]:
    """Return the numbers that differ from the preset, as texts by name.

    The dictionary is empty if `preset_changes` is "".

    Args:
        spec: the record of a Spec, see Spec.record.
    """
    return dict(_changes(spec))


def _changes(spec: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield the name and the value of each number that differs."""
    base = usual_planner(spec)
    if base is None:
        return
    parts = ("sampling", "mppi", "cost")
    if spec.get("sampler") not in SAMPLERS:
        # A user's own sampler flies with the other numbers of colored sampling.
        parts = ("mppi", "cost")
    recorded = spec.get("planner", {})
    for part in parts:
        numbers = recorded.get(part, {})
        for name, usual in vars(getattr(base, part)).items():
            value = numbers.get(name)
            # A JSON record has lists instead of tuples, and leaves out settings that were not given
            usual = list(usual) if isinstance(usual, tuple) else usual
            value = list(value) if isinstance(value, tuple) else value
            if name in numbers and value != usual:
                yield name, number_text(value)


def usual_planner(spec: Mapping[str, Any]) -> Planner | None:
    """Return the planner of a recorded flight with only the numbers of its preset.

    It is None if the preset is a file or does not exist in this version.

    Args:
        spec: the record of a Spec, see Spec.record.
    """
    reference = _reference(spec)
    if reference is None or spec["preset"] not in DERIVED:
        return reference
    scale = recorded_scale(spec)
    return reference if scale is None else _derived(reference, scale)


# Cached, as lists of runs ask for each of them
@lru_cache(maxsize=32)
def _derived(reference: Planner, scale: Scale) -> Planner:
    """Return a planner with the numbers that follow from the scale of a flight."""
    return with_period(derived(reference, scale), scale.period)


def recorded_derivation(spec: Mapping[str, Any]) -> list[DerivedNumber]:
    """Return the derived numbers of a recorded flight, [] if its preset has none.

    Args:
        spec: the record of a Spec, see Spec.record.
    """
    reference = _reference(spec)
    scale = recorded_scale(spec)
    if reference is None or scale is None or spec["preset"] not in DERIVED:
        return []
    weight = spec["planner"]["cost"].get("time_to_go")
    return derivation(reference, scale._replace(may_value=weight != 0.0))


def _reference(spec: Mapping[str, Any]) -> Planner | None:
    """Return the planner of a preset without changes, None if this version lacks the preset.

    A user's own sampler flies with the numbers of colored sampling.
    """
    of_samplers = PRESETS.get(spec.get("preset", ""), {})
    return of_samplers.get(spec.get("sampler", ""), of_samplers.get("colored"))


def recorded_scale(spec: Mapping[str, Any]) -> Scale | None:
    """Return the scale of a recorded flight, None if the record does not determine it.

    Args:
        spec: the record of a Spec, see Spec.record.
    """
    try:
        read = msgspec.convert(dict(spec), RunSpec)
        course = _course(read.course.text, read.course.name)
    except (msgspec.ValidationError, FileError):
        return None
    off = Displacement.of(read.randomization, read.randomize, read.displace_gates)
    seen_late = read.known_from is not None and off.gates > 0.0
    return Scale.of(course, read.vehicle, read.planner.mppi.dt, seen_late)


# Cached, as lists of runs ask for each of them
@lru_cache(maxsize=32)
def _course(text: str, name: str) -> Course:
    """Return the course of a record. Raises FileError."""
    return parse_course(text, name)


def number_text(value: Any) -> str:
    """Return a number or several numbers as text."""
    if isinstance(value, list | tuple):
        return " ".join(map(number_text, value)) or "none"
    return f"{value:g}" if isinstance(value, float) else str(value).lower()
