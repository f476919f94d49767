"""Parse the settings of a flight that are given as one text.

    gaussian                      a sampler, with the preset's numbers for it
    race+target-ess=200           presets, samplers and settings, joined by +
    gaussian+sigma=3:3:.6:6       several numbers are joined by colons
    race+term=mine:calm=50        a user's own cost term and its weight
    controller=mine:Pid           a user's own controller instead of the planner
    race+fault=rotor2=.5@3        a fault in flight; faults and terms may be repeated
    split_s.npz                   a learned pilot instead of the planner: a file, or split_s_swift

Variants of a comparison and entrants of a race of several vehicles are such texts with a name
before them: `soft=race+target-ess=200`. A setting alone, `margin=.3`, has no name.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple

from msgspec import inspect

from quadsim.config.build import referee_of
from quadsim.config.settings import SETTINGS, Kind, SettingError, bare
from quadsim.config.spec import Spec
from quadsim.controllers.learned.pilot import pilot_names
from quadsim.controllers.presets import PRESETS
from quadsim.controllers.samplers import SAMPLERS
from quadsim.course import Course
from quadsim.files.data_files import SUFFIXES
from quadsim.files.yaml_errors import did_you_mean

Place = str | Path | Course  # a course by name, a FILE.yaml, or the course itself
Settings = Mapping[str, Any]  # name of a setting of `quadsim.fly` -> its value, or a text for it
WITH_COLONS = (
    "sampler",
    "controller",
    "term",
    "fault",
)  # settings whose text may have colons of its own
REPEATED = ("term", "fault")  # settings that a text may have several times
SWITCH = {"yes": True, "no": False}
_KINDS = {name: list(setting.kinds.values()) for name, setting in SETTINGS.items()}


class Named(NamedTuple):
    """A text of settings, and the name in front of it."""

    name: str | None  # None: there is none
    parts: str


def named_parts(text: str, more: Mapping[str, Kind] | None = None) -> Named:
    """Return the name and the settings of a text such as "soft=race+target-ess=200".

    The text before the first = is a name if it is followed by a sampler, a preset, a pilot or
    setting=value. It is a setting if it is followed by a value of this setting: "vehicle=paper" is
    not the preset "paper" with a name. "pilot=FILE.npz" is both the name "pilot" and the setting.

    Args:
        text: the text.
        more: kinds of settings in addition to the settings of a flight, by name.
    """
    head, has_value, rest = text.partition("=")
    if not has_value or "+" in head:
        return Named(None, text)
    if head == "pilot":
        return Named(head, text)
    kinds = _KINDS | {name: [kind] for name, kind in (more or {}).items()}
    of_head = kinds.get(_setting_name(head))
    first = rest.partition("+")[0]
    name, is_setting, _ = first.partition("=")
    if is_setting and _setting_name(name) in kinds:
        return Named(head, rest)
    if of_head is None or (_is_part(first) and not _is_value(first, of_head)):
        return Named(head, rest)
    return Named(None, text)


def _is_value(text: str, kinds: Sequence[Kind]) -> bool:
    """Return whether a text is a value of a setting, in range or not.

    Args:
        text: the text after the =.
        kinds: the kinds of the setting.
    """
    for kind in map(bare, kinds):
        match kind:
            case inspect.StrType() | inspect.VarTupleType(inspect.StrType()):
                return True
            case inspect.LiteralType(values) if text in values:
                return True
    try:
        return text in SWITCH or bool([float(number) for number in text.split(":")])
    except ValueError:
        return False


def _is_part(text: str) -> bool:
    """Return whether a text is a sampler, a preset or a pilot."""
    try:
        return bool(_kind_of(text))
    except ValueError:
        return False


def _setting_name(text: str) -> str:
    return text.replace("-", "_")


def parse_parts(text: str) -> dict[str, Any]:
    """Return the settings of a text.

    Args:
        text: presets, samplers, pilots and settings joined by +, such as "race+target-ess=200".

    Raises:
        ValueError: a part is none of these.
    """
    settings: dict[str, Any] = {}
    for part in text.split("+"):
        name, value = parse_part(part)
        if name in REPEATED:
            value = (*settings.get(name, ()), value)
        settings[name] = value
    return settings


def parse_part(part: str) -> tuple[str, Any]:
    """Return the name of a setting and its value or text.

    Args:
        part: a part between two +, such as "target-ess=200" or "gaussian".

    Raises:
        ValueError: the part is neither a setting with a value, a sampler, a preset nor a pilot.
    """
    name, has_value, text = part.partition("=")
    if not has_value:
        return _kind_of(part), part
    setting = _setting_name(name)
    if setting in WITH_COLONS:
        return setting, text
    if text in SWITCH:
        return setting, SWITCH[text]
    numbers = text.split(":")
    return setting, numbers if len(numbers) > 1 else text


def _kind_of(part: str) -> str:
    """Return the name of the setting to which a part without "=" belongs."""
    if part in SAMPLERS or ":" in part:
        return "sampler"
    if part.endswith(".npz") or part in pilot_names():
        return "pilot"
    if part in PRESETS or part.endswith(SUFFIXES):
        return "preset"
    near = did_you_mean(part, [*SAMPLERS, *PRESETS, *pilot_names()])
    raise ValueError(f"no sampler, preset or pilot {part!r}: {near}")


def with_shared(own: Settings, shared: Settings) -> dict[str, Any]:
    """Return the settings of one of several flights, completed by the shared settings.

    Shared settings of a sampler apply only to flights with this sampler.
    """
    others = settings_of_other_samplers(sampler_of(own, shared))
    return {key: value for key, value in shared.items() if key not in others} | dict(own)


def sampler_of(own: Settings, shared: Settings) -> object:
    """Return the sampler of one flight of several, by name or as an object."""
    return own.get("sampler", shared.get("sampler", "colored"))


def settings_of_other_samplers(sampler: object) -> set[str]:
    """Return the settings that only other samplers have, such as gamma."""
    cls = SAMPLERS.get(sampler) if isinstance(sampler, str) else type(sampler)
    own = {f.name for f in fields(cls)} if cls and is_dataclass(cls) else set()
    return {f.name for other in SAMPLERS.values() for f in fields(other)} - own


def resolve(course: Place, settings: Settings) -> Spec:
    """Return the Spec that `quadsim.fly` would use, on one thread.

    Raises:
        SettingError: a setting is invalid.
        FileError: a course, a vehicle or a preset cannot be read.
        ValueError: course, laps and vehicle do not fit together.
    """
    if settings.get("threads"):
        raise SettingError(
            "threads", "attempts fly on one thread each; set jobs, how many fly at once"
        )
    if settings.get("blackbox"):
        raise SettingError("blackbox", "attempts would overwrite each other's log; fly one of them")
    spec = Spec.of(course, **settings)
    referee_of(spec)  # which checks that the gates are wide enough for the vehicle
    return spec
