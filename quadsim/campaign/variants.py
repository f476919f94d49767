"""Variants are what a comparison compares: each is a set of settings of a flight.

gaussian                      a sampler, with the preset's numbers for it
soft=race+target-ess=200      a name; then presets, samplers and settings, joined by +
wild=gaussian+sigma=3:3:.6:6  several numbers are joined by colons
calm=race+term=mine:calm=50   a cost term of one's own and its weight
weak=race+fault=rotor2=.5@3   a fault in flight; faults and terms may be repeated
pilot=split_s.npz             a learned pilot in the planner's place: a file, or split_s_swift
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from controllers.learned.pilot import pilot_names
from controllers.presets import PRESETS
from controllers.samplers import SAMPLERS
from quadsim.campaign.attempt import planner_key
from quadsim.course import Course
from quadsim.files.data_files import SUFFIXES
from quadsim.files.yaml_errors import did_you_mean
from quadsim.spec.build import referee_of
from quadsim.spec.identity import IdentityError, identity_of
from quadsim.spec.settings import SettingError
from quadsim.spec.spec import Spec

Place = str | Path | Course  # a course by name, a FILE.yaml, or the course itself
Settings = Mapping[str, Any]  # name of a setting of `quadsim.fly` -> its value, or a text for it
WITH_COLONS = ("sampler", "term", "fault")  # settings whose text may have colons of its own
REPEATED = ("term", "fault")  # settings that a variant may have several times
SWITCH = {"yes": True, "no": False}


@dataclass(frozen=True)
class Variant:
    """One planner on one course, for any seed."""

    name: str
    spec: Spec
    # Tells variants of one call whose records are equal but whose own parts are different objects:
    # 0 for the first of them, then 1, 2, ...
    twin: int = 0

    @property
    def key(self) -> str:
        """Return a hash of all that decides its flights but the seed and the libraries."""
        return planner_key(self.spec.record())

    @property
    def course(self) -> str:
        """Return the name of the course."""
        return self.spec.course.name

    def attempts(self, number: int) -> list[Spec]:
        """Return a number of flights with consecutive seeds, beginning with the spec's own."""
        first = self.spec.seed
        return [replace(self.spec, seed=seed) for seed in range(first, first + number)]


def parse_variants(text: str) -> dict[str, dict[str, Any]]:
    """Return the settings of each variant of a text, by name.

    Args:
        text: such as "gaussian,soft=race+target-ess=200".

    Raises:
        SettingError: the text names no variants.
    """
    found: dict[str, dict[str, Any]] = {}
    for one in text.split(","):
        name, named, parts = one.strip().partition("=")
        if not name or (named and not parts):
            raise _wrong(f"expected a sampler or NAME=part+part, got {one.strip()!r}")
        if name in found:
            raise _wrong(f"expected different names, got {name!r} twice; name them NAME=...")
        if not name.isprintable():
            raise _wrong(f"expected a name of printable characters, got {name!r}")
        try:
            found[name] = parse_parts(parts if named else name)
        except ValueError as error:
            raise _wrong(str(error)) from None
    return found


def _wrong(problem: str) -> SettingError:
    return SettingError("variants", problem)


def parse_parts(text: str) -> dict[str, Any]:
    """Return the settings of one variant.

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


def make_variants(
    courses: Sequence[Place], variants: Mapping[str, Settings], settings: Settings
) -> list[Variant]:
    """Return every variant on every course, course by course.

    Args:
        courses: names, files or courses.
        variants: the settings of each variant by name.
        settings: settings of all variants; settings of a sampler apply to its variants only.

    Raises:
        SettingError: a setting is invalid.
        FileError: a course, a vehicle or a preset cannot be read.
        ValueError: course, laps and vehicle do not fit together.
    """
    made = []
    for course in courses:
        for name, own in variants.items():
            sampler = own.get("sampler", settings.get("sampler", "colored"))
            others = _settings_of_other_samplers(sampler)
            shared = {key: value for key, value in settings.items() if key not in others}
            made.append(Variant(name, resolve(course, shared | dict(own))))
    return _told_apart(made)


def _told_apart(variants: Sequence[Variant]) -> list[Variant]:
    """Return the variants with the number of each twin, so that none flies under another's name."""
    found: list[Variant] = []
    objects: dict[str, list[list[int]]] = {}
    for variant in variants:
        own = variant.spec.own_objects()
        terms = own.pop("terms", ())
        functions = [term.function for term in terms] if isinstance(terms, tuple) else []
        ids = [id(part) for part in (*own.values(), *functions)]
        # The own parts of the variants with this record so far
        twins = objects.setdefault(variant.key, [])
        if ids not in twins:
            twins.append(ids)
        found.append(replace(variant, twin=twins.index(ids)))
    return found


def expect_identities(variants: Sequence[Variant]) -> None:
    """Check that the own parts of variants can be told from others in a later call.

    Raises:
        SettingError: a part has no identity, so that a campaign could not tell whether it has flown
            before.
    """
    for variant in variants:
        for role, part in variant.spec.own_objects().items():
            try:
                identity_of(part)
            except IdentityError as error:
                wanted = f"expected a {role} that can be told from others"
                raise SettingError("campaign", f"{wanted}, got {error}") from None


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
