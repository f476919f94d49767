"""Presets of one's own: a YAML file that names a preset as its base and says what differs.

base: race
sampling: {gamma: [3, 3, 3, 2]}
mppi: {samples: 2048}
cost: {margin: 0.3}
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from controllers.config import MPPIConfig
from controllers.costs.race import RaceWeights
from controllers.presets import PRESETS, Planner, faults
from controllers.samplers import SamplerConfig
from quadsim.files.data_files import SUFFIXES, read_text
from quadsim.files.strict_yaml import Document, FileError, parse
from quadsim.files.yaml_words import did_you_mean


@dataclass(frozen=True)
class PresetFile:
    """What a preset file may say. A key it leaves out keeps the base's number, whatever the default here."""

    base: str
    vehicle: str | None = None
    sampling: SamplerConfig = field(default_factory=SamplerConfig)
    mppi: MPPIConfig = field(default_factory=MPPIConfig)
    cost: RaceWeights = field(default_factory=RaceWeights)


def load_planner(name_or_path: str, sampler: str) -> Planner:
    """The planner of a named preset or of a preset file, for this sampler. Raises FileError."""
    if name_or_path in PRESETS:
        return PRESETS[name_or_path][sampler]
    if not name_or_path.endswith(SUFFIXES):
        raise FileError(f"no preset {name_or_path!r}: {did_you_mean(name_or_path, PRESETS)} (or a FILE.yaml)")
    return parse_planner(read_text(Path(name_or_path)), name_or_path, sampler)


def parse_planner(text: str, file: str, sampler: str) -> Planner:
    """A planner from a preset file's text. Raises FileError."""
    document = parse(text, file)
    entry = document.fill(PresetFile)
    if entry.base not in PRESETS:
        raise document.error("base", f"no preset {entry.base!r}: {did_you_mean(entry.base, PRESETS)}")
    planner = _overlay(document, entry, PRESETS[entry.base][sampler])
    for path, problem in faults(planner):
        raise document.error(path, problem)
    return planner


def _overlay(document: Document, entry: PresetFile, base: Planner) -> Planner:
    """The base with what the file says, key by key."""
    changes: dict[str, Any] = {}
    for key, node in document.root.value:
        said = getattr(entry, key.value)
        if isinstance(node, yaml.MappingNode):
            keys = [k.value for k, _ in node.value]
            said = replace(getattr(base, key.value), **{k: getattr(said, k) for k in keys})
        changes[key.value] = said
    return replace(base, **{k: v for k, v in changes.items() if k != "base" and v is not None})
