"""Settings of a flight as one text, and the flight that they give.

    gaussian                      a sampler, with the preset's numbers for it
    race+target-ess=200           presets, samplers and settings, joined by +
    gaussian+sigma=3:3:.6:6       several numbers are joined by colons
    race+term=mine:calm=50        a cost term of one's own and its weight
    controller=mine:Pid           a controller of one's own in the planner's place
    race+fault=rotor2=.5@3        a fault in flight; faults and terms may be repeated
    split_s.npz                   a learned pilot in the planner's place: a file, or split_s_swift

Variants of a comparison and entrants of a race of several vehicles are such texts with a name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from controllers.learned.pilot import pilot_names
from controllers.presets import PRESETS
from controllers.samplers import SAMPLERS
from quadsim.config.build import referee_of
from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
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


def parse_parts(text: str) -> dict[str, Any]:
    """Return the settings of a text.

    Args:
        text: presets, samplers, pilots and settings joined by +, such as "race+target-ess=200".

    Raises:
        ValueError: a part is none of these.
    """
    settings: dict[str, Any] = {}
    for part in text.split("+"):
        name, value = _setting(part)
        if name in REPEATED:
            value = (*settings.get(name, ()), value)
        settings[name] = value
    return settings


def _setting(part: str) -> tuple[str, Any]:
    """Return the name of a setting and its value or text."""
    name, has_value, text = part.partition("=")
    if not has_value:
        return _kind_of(part), part
    setting = name.replace("-", "_")
    if setting in WITH_COLONS:
        return setting, text
    if text in SWITCH:
        return setting, SWITCH[text]
    numbers = text.split(":")
    return setting, numbers if len(numbers) > 1 else text


def _kind_of(part: str) -> str:
    """Return the name of the setting that a part without a value is for."""
    if part in SAMPLERS or ":" in part:
        return "sampler"
    if part.endswith(".npz") or part in pilot_names():
        return "pilot"
    if part in PRESETS or part.endswith(SUFFIXES):
        return "preset"
    near = did_you_mean(part, [*SAMPLERS, *PRESETS, *pilot_names()])
    raise ValueError(f"no sampler, preset or pilot {part!r}: {near}")


def with_shared(own: Settings, shared: Settings) -> dict[str, Any]:
    """Return the settings of one flight of several: its own, and the shared ones that it has not.

    Settings of a sampler apply to the flights with this sampler only.
    """
    sampler = own.get("sampler", shared.get("sampler", "colored"))
    others = _settings_of_other_samplers(sampler)
    return {key: value for key, value in shared.items() if key not in others} | dict(own)


def _settings_of_other_samplers(sampler: object) -> set[str]:
    """Return the settings that this sampler lacks and another has, such as gamma."""
    cls = SAMPLERS.get(sampler) if isinstance(sampler, str) else type(sampler)
    own = {f.name for f in fields(cls)} if cls and is_dataclass(cls) else set()
    return {f.name for other in SAMPLERS.values() for f in fields(other)} - own


def resolve(course: Place, settings: Settings) -> Spec:
    """Return the Spec that `quadsim.fly` would fly, on one thread.

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
