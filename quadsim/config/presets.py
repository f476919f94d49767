"""Presets of a planner: named presets, and YAML files that change a named preset.

A preset file holds the numbers that differ from those of its base:

    base: race
    sampling: {gamma: [3, 3, 3, 2]}
    mppi: {samples: 2048}
    cost: {margin: 0.3}
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import yaml
from msgspec import defstruct

from quadsim.config.settings import CONTROL_UNITS
from quadsim.controllers.derived import DERIVED, Scale, derived
from quadsim.controllers.presets import (
    PRESETS,
    Planner,
    contradictions,
    instead_of,
    preset,
    with_period,
)
from quadsim.controllers.samplers import SAMPLERS
from quadsim.dynamics.quadrotor import Control
from quadsim.files.data_files import SUFFIXES, read_text
from quadsim.files.strict_yaml import Document, parse, unit

GROUPS = ("sampling", "mppi", "cost")  # groups of numbers in a Planner and in a preset file


@dataclass(frozen=True)
class PresetSource:
    """A named preset, or the text of a preset file."""

    name: str
    text: str | None = None  # None: a named preset

    @classmethod
    def read(cls, name_or_path: str) -> PresetSource:
        """Return a preset by name or by the path of a YAML file. Raises FileError."""
        if name_or_path.endswith(SUFFIXES):
            return cls(name_or_path, read_text(Path(name_or_path)))
        return cls(name_or_path)

    def planner(self, sampler: str, firmware: bool = False, scale: Scale | None = None) -> Planner:
        """Return the preset's numbers for a registered sampler. Raises FileError.

        Args:
            sampler: name of the sampler.
            firmware: whether a firmware carries out the commands.
            scale: scale of the flight, from which numbers follow; None: the reference's scale.
        """
        if self.text is None:
            return _named(self.name, sampler, firmware, scale)
        return parse_planner(self.text, self.name, sampler, firmware, scale)


def _named(name: str, sampler: str, firmware: bool, scale: Scale | None) -> Planner:
    """Return the numbers of a named preset; its plan is smoothed if a firmware flies.

    An ideal rate loop follows a plan that changes in each period. A firmware has lags of
    filters and gains: it cannot follow, and loses thrust in trying. The flights in
    docs/betaflight_results.md show this.
    """
    found = preset(name, sampler)
    if scale is not None and name in DERIVED:
        found = derived(found, scale)
    return replace(found, mppi=replace(found.mppi, smooth=True)) if firmware else found


def parse_planner(
    text: str,
    file: str,
    sampler: str,
    firmware: bool = False,
    scale: Scale | None = None,
) -> Planner:
    """Return the planner of a preset file's text.

    If the file leaves out a key, the number of its base is kept. Keys of other samplers are
    skipped, so that one file serves several samplers.

    Args:
        text: the YAML.
        file: name of the file, for errors.
        sampler: name of the sampler.
        firmware: whether a firmware carries out the commands.
        scale: scale of the flight, from which numbers of the base follow; None: the
            reference's scale.

    Raises:
        FileError: the file is not a preset.
    """
    document = parse(text, file)
    base = _base(document, sampler, firmware, scale)
    entry = document.fill(_schema(base))
    changes: dict[str, Any] = {"preset": file, "vehicle": entry.vehicle or base.vehicle}
    for group, keys in _groups(document):
        given = getattr(entry, group)
        base_part = getattr(base, group)
        if group == "mppi" and "dt" in keys and given.dt is not None:
            base_part = with_period(base, given.dt).mppi
        known = {f.name for f in fields(base_part)}
        numbers = {key: getattr(given, key) for key in keys if key in known}
        changes[group] = replace(base_part, **numbers)
    planner = replace(base, **changes)
    document.check(contradictions(planner))
    return planner


def _groups(document: Document) -> Iterator[tuple[str, list[str]]]:
    """Yield the name and the keys of each group in the file."""
    for key, node in document.root.value:
        if key.value in GROUPS and isinstance(node, yaml.MappingNode):
            yield key.value, [k.value for k, _ in node.value]


def _base(document: Document, sampler: str, firmware: bool, scale: Scale | None) -> Planner:
    """Return the preset that the file's `base` names.

    If the file has no `base`, the first preset is returned; the schema reports the missing key.
    """
    name = None
    # Anything but a mapping is refused by the schema
    pairs = document.root.value if isinstance(document.root, yaml.MappingNode) else ()
    for key, node in pairs:
        if isinstance(key, yaml.ScalarNode) and key.value == "base":
            name = node.value
    if not isinstance(name, str):
        return _named(next(iter(PRESETS)), sampler, firmware, scale)
    if name not in PRESETS:
        raise document.error("base", f"no preset {name!r}: {instead_of(name)}")
    return _named(name, sampler, firmware, scale)


def _schema(base: Planner) -> type[Any]:
    """Return the schema of a preset file: all numbers of the base's groups, as optional keys."""
    keys: list[Any] = [("base", str), ("vehicle", str | None, None)]
    for group in GROUPS:
        base_class = type(getattr(base, group))
        classes = SAMPLERS.values() if group == "sampling" else (base_class,)
        kinds: dict[str, Any] = {}
        for cls in classes:
            kinds |= get_type_hints(cls, include_extras=True)
        numbers = [(name, _of_each_control(name, kind), None) for name, kind in kinds.items()]
        keys.append((group, defstruct(group, numbers), None))
    return defstruct("PresetFile", keys)


def _of_each_control(name: str, kind: Any) -> Any:
    """Return the type of a tuple with one number for each control; other types are unchanged."""
    if get_origin(kind) is Annotated:
        inner, *metadata = get_args(kind)
        return Annotated[_of_each_control(name, inner), *metadata]
    if get_origin(kind) is not tuple or get_args(kind)[1:] != (...,):
        return kind
    whole = tuple[(get_args(kind)[0],) * len(Control._fields)]
    return Annotated[whole, unit(CONTROL_UNITS)] if name == "sigma" else whole
