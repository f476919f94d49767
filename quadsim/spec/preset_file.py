"""Preset files: a YAML file that names a preset as its base and says what differs.

base: race
sampling: {gamma: [3, 3, 3, 2]}
mppi: {samples: 2048}
cost: {margin: 0.3}
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import yaml
from msgspec import defstruct

from controllers.presets import Planner, Presets, faults, preset
from controllers.samplers import SAMPLERS
from quadsim.files.data_files import SUFFIXES, read_text
from quadsim.files.strict_yaml import Document, parse, unit
from quadsim.files.yaml_errors import did_you_mean

GROUPS = ("sampling", "mppi", "cost")


def load_planner(name_or_path: str, sampler: str, presets: Presets, units: str = "") -> Planner:
    """The planner of a named preset or of a preset file, for this sampler; units: of the controls.
    Raises FileError."""
    if name_or_path.endswith(SUFFIXES):
        return parse_planner(read_text(Path(name_or_path)), name_or_path, sampler, presets, units)
    return preset(name_or_path, sampler, presets)


def parse_planner(text: str, file: str, sampler: str, presets: Presets, units: str = "") -> Planner:
    """A planner from a preset file's text: a key that it leaves out keeps the base's number. Raises
    FileError.

    Of `sampling`, keys of other samplers are skipped, so that one file serves several. units: of
    the controls.
    """
    document = parse(text, file)
    base = _base(document, sampler, presets)
    entry = document.fill(_schema(base, units))
    changes: dict[str, Any] = {"vehicle": entry.vehicle or base.vehicle}
    for key, node in document.root.value:
        if key.value in GROUPS and isinstance(node, yaml.MappingNode):
            own = {f.name for f in fields(getattr(base, key.value))}
            said = {
                k.value: getattr(getattr(entry, key.value), k.value)
                for k, _ in node.value
                if k.value in own
            }
            changes[key.value] = replace(getattr(base, key.value), **said)
    planner = replace(base, **changes)
    for path, problem in faults(planner):
        raise document.error(path, problem)
    return planner


def _base(document: Document, sampler: str, presets: Presets) -> Planner:
    """What the file's `base` names; the first preset where it says none, for the error that
    follows."""
    nodes = {
        key.value: node
        for key, node in getattr(document.root, "value", ())
        if isinstance(key, yaml.ScalarNode)
    }
    name = getattr(nodes.get("base"), "value", None)
    if isinstance(name, str) and name not in presets:
        raise document.error("base", f"no preset {name!r}: {did_you_mean(name, presets)}")
    return preset(name if isinstance(name, str) else next(iter(presets)), sampler, presets)


def _schema(base: Planner, units: str) -> type:
    """What a preset file on this base may say: every number of its groups, none required."""
    keys: list[Any] = [("base", str), ("vehicle", str | None, None)]
    for group in GROUPS:
        classes = SAMPLERS.values() if group == "sampling" else (type(getattr(base, group)),)
        kinds = {
            name: kind
            for cls in classes
            for name, kind in get_type_hints(cls, include_extras=True).items()
        }
        each = [
            (name, _of_each_control(name, kind, base, units), None) for name, kind in kinds.items()
        ]
        keys.append((group, defstruct(group, each), None))
    return defstruct("PresetFile", keys)


def _of_each_control(name: str, kind: Any, base: Planner, units: str) -> Any:
    """A tuple of any length as one with a number for each control; other kinds as they are."""
    if get_origin(kind) is not tuple or get_args(kind)[1:] != (...,):
        return kind
    whole = tuple[(get_args(kind)[0],) * len(base.sampling.sigma)]
    return Annotated[whole, unit(units)] if name == "sigma" else whole
