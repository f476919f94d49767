"""Variants: what a comparison compares, each a set of settings of a flight; and the flags that
campaigns share.

gaussian                      a sampler, with the preset's numbers for it
soft=race+target-ess=200      a name; then presets, samplers and settings of `race fly`, joined by +
wild=gaussian+sigma=3:3:.6:6  several numbers are joined by colons
calm=race+term=mine:calm=50   a cost term of one's own and its weight
pilot=split_s.npz             a learned pilot in the planner's place: a file, or split_s_swift
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

from msgspec import Meta

from controllers.learned.pilot import pilot_names
from controllers.samplers import SAMPLERS
from quadsim.campaign.attempt import planner_key
from quadsim.cli.flags import Given, Help, run_command, settings_as_flags
from quadsim.console import UsageError
from quadsim.files.data_files import SUFFIXES
from quadsim.files.yaml_errors import did_you_mean
from quadsim.spec.spec import Spec
from quadsim.spec.systems import SYSTEMS

NAMES_OF_CODE = ("sampler", "term")  # settings whose text names a module, with a colon in it
CAMPAIGN = "campaigns/race.sqlite"
Campaign = Annotated[str, Help("FILE.sqlite where attempts are kept")]
Jobs = Annotated[
    Annotated[int, Meta(ge=1)] | None, Help("attempts at once; default: one for each core")
]
Scheduler = Annotated[
    str | None, Help("tcp://HOST:PORT of a Dask cluster; default: processes here")
]


@dataclass(frozen=True)
class Variant:
    """One planner on one course, for any seed."""

    name: str
    spec: Spec

    @property
    def key(self) -> str:
        return planner_key(self.spec.record())

    @property
    def course(self) -> str:
        return self.spec.course.name

    def attempts(self, number: int) -> list[Spec]:
        """Consecutive seeds, beginning with the spec's own."""
        return [replace(self.spec, seed=self.spec.seed + i) for i in range(number)]


def parse_variants(text: str) -> dict[str, dict[str, Any]]:
    """{name: settings} of "gaussian,soft=race+target-ess=200". Raises UsageError."""
    found: dict[str, dict[str, Any]] = {}
    for one in text.split(","):
        name, named, parts = one.strip().partition("=")
        if not name or (named and not parts):
            raise UsageError(
                f"--variants: expected a sampler or NAME=part+part, got {one.strip()!r}"
            )
        if name in found:
            raise UsageError(
                f"--variants: expected different names, got {name!r} twice; name them NAME=..."
            )
        if not name.isprintable():
            raise UsageError(f"--variants: expected a name of printable characters, got {name!r}")
        found[name] = dict(_setting(part) for part in (parts if named else name).split("+"))
    return found


def make_variants(
    courses: Sequence[Any], variants: Mapping[str, Mapping[str, Any]], settings: Mapping[str, Any]
) -> list[Variant]:
    """Every variant on every course, course by course; `settings` hold for all. Raises UsageError,
    FileError."""
    made = []
    for course in courses:
        for name, own in variants.items():
            sampler = own.get("sampler", settings.get("sampler", "colored"))
            shared = {k: v for k, v in settings.items() if not _of_other_samplers(k, sampler)}
            made.append(Variant(name, resolve(course, shared | dict(own))))
    return made


def resolve(course: Any, settings: Mapping[str, Any] | Given) -> Spec:
    """What `race fly` would fly, on one thread. Raises UsageError, FileError."""
    if settings and settings.get("threads"):
        raise UsageError("--threads: attempts fly on one thread each; --jobs says how many at once")
    with settings_as_flags():
        spec = Spec.of(course, **(settings or {}))
        spec.entry.referee(spec)
    return spec


def words_as_settings(words: Sequence[str]) -> tuple[str, dict[str, Any]]:
    """(course, settings) of a command line of `race fly` that stands in a file. Raises
    UsageError."""
    found: list[tuple[str, dict[str, Any]]] = []

    def flight(course: str = "split_s_swift", /, *, settings: Given = None) -> int:
        found.append((course, settings or {}))
        return 0

    if {"--help", "-h"} & set(words):
        raise UsageError(f"expected what `race fly` flies, got {' '.join(words)!r}")
    run_command(flight, "race fly", words)
    return found[0]


def _setting(part: str) -> tuple[str, Any]:
    name, has_value, text = part.partition("=")
    if not has_value:
        presets = dict.fromkeys(preset for entry in SYSTEMS.values() for preset in entry.presets)
        if part in SAMPLERS or ":" in part:
            return "sampler", part
        if part.endswith(".npz") or part in pilot_names():
            return "pilot", part
        if part not in presets and not part.endswith(SUFFIXES):
            raise UsageError(
                f"--variants: no sampler or preset {part!r}: {did_you_mean(part, [*SAMPLERS, *presets])}"
            )
        return "preset", part
    setting = name.replace("-", "_")
    if text in ("yes", "no"):
        return setting, text == "yes"
    if setting in NAMES_OF_CODE:
        return setting, text
    numbers = text.split(":")
    return setting, numbers if len(numbers) > 1 else text


def _of_other_samplers(setting: str, sampler: Any) -> bool:
    """Such as gamma, for a Gaussian sampler."""
    known = {name for cls in SAMPLERS.values() for name in cls.__dataclass_fields__}
    cls = SAMPLERS.get(sampler) if isinstance(sampler, str) else type(sampler)
    return setting in known and setting not in getattr(cls, "__dataclass_fields__", ())
