"""The variants of a comparison, each a set of settings of a flight, and their texts.

gaussian                      a sampler, with the preset's numbers for it
soft=race+target-ess=200      a name; then presets, samplers and settings, joined by +
race+target-ess=200           without a name, which is then the whole text
wild=gaussian+sigma=3:3:.6:6  several numbers are joined by colons
calm=race+term=mine:calm=50   a cost term of one's own and its weight
weak=race+fault=rotor2=.5@3   a fault in flight; faults and terms may be repeated
pilot=split_s.npz             a learned pilot in the planner's place: a file, or split_s_swift
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import FunctionType
from typing import Any

from quadsim.campaign.run.attempt import planner_key
from quadsim.config.identity import IdentityError, identity_of
from quadsim.config.setting_texts import (
    Place,
    Settings,
    named_parts,
    parse_parts,
    resolve,
    with_shared,
)
from quadsim.config.settings import SettingError
from quadsim.config.spec import Spec
from quadsim.controllers.samplers import SAMPLERS
from quadsim.files.yaml_errors import shown_value


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
        """Return a hash of everything that decides its flights, except seed and libraries."""
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
    for one in map(str.strip, text.split(",")):
        named, parts = named_parts(one)
        name = one if named is None else named
        if not name or not parts:
            raise _wrong(f"expected a sampler or NAME=part+part, got {one!r}")
        if name in found:
            raise _wrong(f"expected different names, got {name!r} twice; name them NAME=...")
        if not name.isprintable():
            raise _wrong(f"expected a name of printable characters, got {name!r}")
        try:
            found[name] = parse_parts(parts)
        except ValueError as error:
            raise _wrong(str(error)) from None
    return found


def named_variants(
    variants: Mapping[str, Settings | str] | Sequence[str] | str,
) -> dict[str, Settings]:
    """Return the settings of each variant by name, as they are given in Python.

    Args:
        variants: {name: settings}, with settings as a mapping or as a text such as
            "race+target-ess=200"; texts, each as in `parse_variants`, or one text.

    Raises:
        SettingError: no variants are named.
    """
    if isinstance(variants, str):
        return dict(parse_variants(variants))
    if not isinstance(variants, Mapping):
        return dict(parse_variants(",".join(_as_text(one) for one in variants)))
    return {name: _own_settings(name, own) for name, own in variants.items()}


def _as_text(one: object) -> str:
    if isinstance(one, str):
        return one
    raise _wrong(f"expected texts, or a mapping {{name: settings}}, got {shown_value(one)}")


def _own_settings(name: str, own: object) -> Settings:
    """Return the settings of a variant, whose name may be that of its sampler."""
    if isinstance(own, str):
        try:
            return parse_parts(own)
        except ValueError as error:
            raise _wrong(f"{name}: {error}") from None
    if not isinstance(own, Mapping):
        raise _wrong(f"{name}: expected settings as a mapping or a text, got {shown_value(own)}")
    return {"sampler": name, **own} if name in SAMPLERS else dict(own)


def _wrong(problem: str) -> SettingError:
    return SettingError("variants", problem)


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
            made.append(Variant(name, resolve(course, with_shared(own, settings))))
    return told_apart(made)


def told_apart(variants: Sequence[Variant]) -> list[Variant]:
    """Return the variants with numbers as twins, by which equal records with other objects differ.

    Variants whose records are equal may have different objects of the user's own. The first of them
    has the twin 0, the next one 1, and so on.
    """
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
        expect_identity(variant.spec)


def expect_identity(spec: Spec) -> None:
    """Check that the own parts of a flight can be told from others in a later call.

    Raises:
        SettingError: a part has no identity.
    """
    for role, part in spec.own_objects().items():
        try:
            identity_of(part)
        except IdentityError as error:
            wanted = f"expected a {role} that can be told from others"
            raise SettingError("campaign", f"{wanted}, got {error}") from None


def expect_importable(spec: Spec) -> None:
    """Check that worker processes can import the own parts of a flight.

    Raises:
        SettingError: a part is defined in a notebook or a shell, which have no file.
    """
    if hasattr(sys.modules["__main__"], "__file__"):
        return
    for role, part in spec.own_objects().items():
        parts = part if isinstance(part, tuple) else (part,)
        for one in parts:
            made = getattr(one, "function", one)  # of a Term
            kind = made if isinstance(made, type | FunctionType) else type(made)
            if kind.__module__ == "__main__":
                advice = "save it in a file and import it, or leave out jobs"
                wanted = f"expected a {role} that workers can import"
                raise SettingError("jobs", f"{wanted}, got one of a notebook or shell: {advice}")
