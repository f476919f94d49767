"""Presets of one's own: a YAML file that names a preset as its base and says what differs.

base: race
sampling: {gamma: [3, 3, 3, 2]}
mppi: {samples: 2048}
cost: {margin: 0.3}
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any

import yaml
from msgspec import Meta

from controllers.config import MPPIConfig
from controllers.costs.race import RaceWeights
from controllers.presets import PRESETS, Planner, faults, preset
from controllers.samplers import Sampling, make_sampler
from controllers.samplers.colored import Law
from controllers.samplers.lane_sampler import Shift
from quadsim.files.data_files import SUFFIXES, read_text
from quadsim.files.strict_yaml import Document, FileError, parse, unit

Sigma = Annotated[float, Meta(gt=0, le=1000)]
Gamma = Annotated[float, Meta(ge=0, le=10)]


@dataclass(frozen=True)
class SamplingNumbers:
    """The numbers of every sampler, for the quadrotor's four controls; a sampler skips those that it does not have."""

    sigma: Annotated[tuple[Sigma, Sigma, Sigma, Sigma], unit("rad/s, rad/s, rad/s, m/s^2")] = (
        1.0,
        1.0,
        1.0,
        1.0,
    )  # standard deviation of body rates [rad/s] and thrust [m/s^2]
    gamma: tuple[Gamma, Gamma, Gamma, Gamma] = (0.0, 0.0, 0.0, 0.0)  # PSD ~ 1/f^gamma; colored only
    law: Law = "exact"  # of the colored noise; colored only
    shift: Shift = "corrected"  # of the momentum with time; smooth and smooth_star only

    @classmethod
    def of(cls, sampling: Sampling) -> SamplingNumbers:
        return cls(**asdict(sampling))

    def of_sampler(self, name: str) -> Sampling:
        return make_sampler(name, **vars(self))


@dataclass(frozen=True)
class PresetFile:
    """What a preset file may say. A key it leaves out keeps the base's number, whatever the default here."""

    base: str
    vehicle: str | None = None
    sampling: SamplingNumbers = field(default_factory=SamplingNumbers)
    mppi: MPPIConfig = field(default_factory=MPPIConfig)
    cost: RaceWeights = field(default_factory=RaceWeights)


def load_planner(name_or_path: str, sampler: str) -> Planner:
    """The planner of a named preset or of a preset file, for this sampler. Raises FileError."""
    if name_or_path in PRESETS or not name_or_path.endswith(SUFFIXES):
        return preset(name_or_path, sampler)
    return parse_planner(read_text(Path(name_or_path)), name_or_path, sampler)


def parse_planner(text: str, file: str, sampler: str) -> Planner:
    """A planner from a preset file's text. Raises FileError."""
    document = parse(text, file)
    entry = document.fill(PresetFile)
    try:
        base = preset(entry.base, sampler)
    except FileError as error:
        raise document.error("base", str(error)) from None
    planner = _overlay(document, entry, base)
    for path, problem in faults(planner):
        raise document.error(path, problem)
    return planner


def _overlay(document: Document, entry: PresetFile, base: Planner) -> Planner:
    """The base with what the file says, key by key."""
    changes: dict[str, Any] = {}
    for key, node in document.root.value:
        said = getattr(entry, key.value)
        if isinstance(node, yaml.MappingNode):
            part = getattr(base, key.value)
            known = {f.name for f in fields(part)}  # a number of another sampler is skipped
            keys = [k.value for k, _ in node.value if k.value in known]
            said = replace(part, **{k: getattr(said, k) for k in keys})
        changes[key.value] = said
    return replace(base, **{k: v for k, v in changes.items() if k != "base" and v is not None})
