"""Line-ups: the entrants of a race as text or as Python objects.

colored                       a sampler, with the preset's numbers for it
soft=race+target-ess=200      a name; then presets, samplers and settings, joined by +
colored+vehicle=cpc           no name, so the whole text is the name
pilot=split_s_swift           a learned pilot instead of the planner
colored+expect=velocity       with a setting of the prediction of other vehicles
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from typing import Any, NamedTuple

from msgspec import inspect

from quadsim.config.resolve import DEFAULT_COURSE, KEYWORDS
from quadsim.config.setting_texts import (
    Place,
    Settings,
    named_parts,
    parse_parts,
    resolve,
    with_shared,
)
from quadsim.config.spec import Spec
from quadsim.files.values import SettingError, checked
from quadsim.files.yaml_errors import did_you_mean, shown_value
from quadsim.heat.settings import Awareness, HeatSettings
from quadsim.heat.spec import Entrant, HeatSpec

KINDS = {
    field.name: field.type
    for field in inspect.type_info(HeatSettings).fields  # pyright: ignore[reportAttributeAccessIssue]
}
# Texts, settings of a flight, Specs or Entrants; or the settings by name
Entrants = Sequence[str | Mapping[str, Any] | Spec | Entrant] | Mapping[str, Settings]
OF_AWARENESS = tuple(f.name for f in fields(Awareness))


def line_up(
    course: Place | None,
    entrants: Entrants,
    settings: Mapping[str, Any],
) -> tuple[tuple[Entrant, ...], HeatSettings]:
    """Return the entrants of a race, and the race's settings.

    Args:
        course: a name, a FILE.yaml or a Course; None: the default course.
        entrants: texts, settings of a flight, Specs or Entrants; or a dict of settings by name.
        settings: settings of the race and of all flights.

    Raises:
        SettingError: a setting or an entrant is invalid.
        FileError: a file cannot be read.
    """
    if isinstance(entrants, str):
        raise SettingError(
            "entrants", f"expected a list of entrants, got the text {entrants!r}: put it in a list"
        )
    heat = heat_settings({name: settings[name] for name in settings if name in KINDS})
    shared = {name: value for name, value in settings.items() if name not in KINDS}
    if isinstance(entrants, Mapping):
        given = list(entrants.items())
    else:
        given = [_named(one) for one in entrants]
    made = []
    for name, one in given:
        if isinstance(one, Entrant):
            made.append(_Made(one.name, None, one.spec, one.awareness))
        elif isinstance(one, Spec):
            made.append(_Made(name, one.flown_by, one, None))
        else:
            made.append(_entrant(name, one, course, shared, heat))
    return _with_names(made), heat


class _Made(NamedTuple):
    """An entrant whose name is not final, as it may need a number."""

    name: str | None  # None: the entrant was given without a name
    kind: str | None  # default name, numbered if it occurs twice
    spec: Spec
    awareness: Awareness | None


def _with_names(made: Sequence[_Made]) -> tuple[Entrant, ...]:
    """Return the entrants; entrants without a name are called "colored", "colored 2" and so on."""
    seen: Counter[str] = Counter()
    found = []
    for one in made:
        name = one.name
        if name is None:
            kind = str(one.kind)
            seen[kind] += 1
            name = kind if seen[kind] == 1 else f"{kind} {seen[kind]}"
        found.append(Entrant(name, one.spec, one.awareness))
    return tuple(found)


def heat_settings(given: Mapping[str, Any]) -> HeatSettings:
    """Return the settings of a race. Raises SettingError."""
    return HeatSettings(**_read(given))


def heats_of(
    entrants: tuple[Entrant, ...],
    settings: HeatSettings,
    seed: int,
    starts: int,
    rotate: bool = True,
) -> list[HeatSpec]:
    """Return several races of the same entrants with consecutive seeds.

    Args:
        entrants: the entrants.
        settings: settings of the races.
        seed: seed of the first race.
        starts: number of races.
        rotate: whether the places are rotated by one from each race to the next, so that each
            entrant starts from each place equally often.

    Raises:
        SettingError: the entrants cannot race, or `starts` is not a positive integer.
    """
    if not isinstance(starts, int) or starts < 1:
        raise SettingError("starts", f"expected a whole number >= 1, got {shown_value(starts)}")
    return [
        HeatSpec(entrants, settings, seed + k, k % max(len(entrants), 1) if rotate else 0)
        for k in range(starts)
    ]


def parse_heat_variants(text: str) -> dict[str, dict[str, Any]]:
    """Return settings of races, by name.

    Args:
        text: parts joined by commas, such as "expect=own,gentle=expect=own+keep-weight=50". A
            part without a name is its own name.

    Raises:
        SettingError: a part is not a setting, or two parts have the same name.
    """
    found: dict[str, dict[str, Any]] = {}
    for one in text.split(","):
        name, parts = _named(one.strip())
        key = name or one.strip()
        if key in found:
            raise SettingError("variants", f"expected different names, got {key!r} twice")
        try:
            found[key] = parse_parts(parts)
        except ValueError as error:
            raise SettingError("variants", str(error)) from None
    return found


def parts_of(texts: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return the texts of the user's own parts of a recorded race, by entrant and by role.

    Args:
        texts: texts such as "mine=controller=package.module:Class"; + joins several parts.

    Raises:
        SettingError: a text does not have this form.
    """
    found = {}
    for text in texts:
        # The name of an entrant may have an = itself
        found_name = re.fullmatch(r"(.+)=((?:controller|sampler|term)=.*)", text)
        name, parts = found_name.groups() if found_name else ("", "")
        try:
            if not name:
                raise ValueError(f"expected NAME=controller=package.module:Class, got {text!r}")
            found[name] = parse_parts(parts)
        except ValueError as error:
            raise SettingError("parts", str(error)) from None
    return found


def _named(one: object) -> tuple[str | None, Any]:
    """Return the name of an entrant, None if it has no name, and its settings."""
    if isinstance(one, str):
        return named_parts(one, KINDS)
    if isinstance(one, Entrant):
        return one.name, one
    if isinstance(one, Spec):
        return None, one
    if isinstance(one, Mapping):
        settings = dict(one)
        return settings.pop("name", None), settings
    wanted = "expected a text, a dictionary of settings, a Spec or an Entrant"
    raise SettingError("entrants", f"{wanted}, got {type(one).__name__}")


def _entrant(
    name: str | None,
    one: str | Settings,
    course: Place | None,
    shared: Settings,
    heat: HeatSettings,
) -> _Made:
    """Return the entrant of a text, of settings or of the record of a flight.

    Raises:
        SettingError: a setting is invalid.
        RecordError: the recorded flight cannot be flown again.
    """
    if isinstance(one, str):
        kind = one
        try:
            own = parse_parts(one)
        except ValueError as error:
            raise SettingError("entrants", str(error)) from None
    elif isinstance(one.get("course"), Mapping):  # `spec` of a recorded run
        spec = Spec.of_record(one)
        return _Made(name, spec.flown_by, spec, None)
    else:
        own = dict(one)
        kind = str(own.get("pilot") or own.get("sampler") or shared.get("sampler", "colored"))
    of_awareness = {key: own.pop(key) for key in list(own) if key in OF_AWARENESS}
    awareness = None
    if of_awareness:
        awareness = Awareness(**(asdict(heat.awareness) | _read(of_awareness)))
    for key in own:
        if key not in KEYWORDS:
            near = did_you_mean(key, [*KEYWORDS, *OF_AWARENESS])
            raise SettingError(key, f"no such setting of an entrant, {near}")
    spec = resolve(course or DEFAULT_COURSE, with_shared(own, shared))
    if not isinstance(one, str) and spec.controller is not None:
        kind = spec.flown_by
    return _Made(name, kind, spec, awareness)


def _read(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the checked settings of a race, with texts converted to values and without None.

    Raises:
        SettingError: a setting is invalid.
    """
    return {
        name: checked(name, value, KINDS[name])
        for name, value in given.items()
        if value is not None
    }
