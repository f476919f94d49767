"""Settings: every number and choice of a flight by name, for the command line, for Python and for
preset files.

A setting is a field of one of the dataclasses below; its annotation holds unit, range and help.
quadsim.spec.resolve makes the fields of a Spec of what was given.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from msgspec import Meta, inspect

from controllers.costs.race import Weight
from controllers.presets import Planner
from controllers.samplers import SAMPLERS
from quadsim.files.strict_yaml import setting
from quadsim.files.yaml_values import Misfit, value
from quadsim.files.yaml_words import NULL, TEXT, expected, unless_null
from quadsim.sensing import PERFECT
from quadsim.spec.systems import SystemEntry

Count = Annotated[int, Meta(ge=1)]


class SettingError(ValueError):
    """An invalid setting: its name, the value expected with its unit, the value found."""

    def __init__(self, name: str, problem: str):
        super().__init__(f"{name}: {problem}")
        self.name, self.problem = name, problem


@dataclass(frozen=True)
class FlightSettings:
    """Options of a flight; None: the value of the course, the vehicle or the preset."""

    system: (
        Annotated[
            Literal["quadrotor"],
            setting("default: the one the course is for"),
        ]
        | None
    ) = None
    sampler: Annotated[str, setting("sampling distribution of the perturbations")] = "colored"
    pilot: (
        Annotated[
            str, setting("a learned pilot in the planner's place: FILE.npz, or split_s_swift")
        ]
        | None
    ) = None
    preset: (
        Annotated[
            str,
            setting(
                "source of defaults: a name or a FILE.yaml (default: race; paper for other systems)"
            ),
        ]
        | None
    ) = None
    vehicle: (
        Annotated[
            str, setting("a name (see `race vehicles`) or a FILE.yaml (default: the preset's)")
        ]
        | None
    ) = None
    thrust_to_weight: (
        Annotated[float, setting("override the thrust-to-weight ratio", gt=1, le=20)] | None
    ) = None
    laps: (
        Annotated[int, setting("laps from standing start (default: the course's)", ge=1, le=1000)]
        | None
    ) = None
    seed: Annotated[int, setting("random seed", ge=0, le=10**9)] = 0
    randomize: Annotated[
        float, setting("scale of domain randomization: start, vehicle, gusts", ge=0, le=3)
    ] = 0.0
    sensing: Annotated[
        str,
        setting("sensors: a name (see quadsim/sensing) or a FILE.yaml; perfect: the true state"),
    ] = PERFECT
    displace_gates: Annotated[
        float, setting("move gates off the map by up to this along x, y [m]", unit="m", ge=0, le=1)
    ] = 0.0
    view_weight: (
        Annotated[
            Weight,
            setting(
                "of a camera looking where it flies (default with displaced gates: the preset's)"
            ),
        ]
        | None
    ) = None
    term: Annotated[
        tuple[str, ...],
        setting(
            "a cost term of your own, as package.module:function=WEIGHT; may be given several times"
        ),
    ] = ()
    timeout: (
        Annotated[
            float, setting("time limit [s] (default: set by the course)", unit="s", gt=0, le=1e5)
        ]
        | None
    ) = None
    threads: (
        Annotated[Count, setting("CPU threads (default: all); results do not depend on it")] | None
    ) = None
    penalties: Annotated[bool, setting("a hit adds 3 s instead of ending the flight")] = False
    plant: (
        Annotated[
            Literal["bullet", "rigid", "rotorpy"],
            setting("simulator (default: bullet if PyBullet is installed)"),
        ]
        | None
    ) = None
    plant_dt: (
        Annotated[
            float, setting("physics step [s] (default: the system's)", unit="s", ge=1e-4, le=0.02)
        ]
        | None
    ) = None
    clock: Annotated[
        Literal["simulated", "wall"],
        setting("wall: simulated time runs on while the controller plans"),
    ] = "simulated"
    deadline_ms: (
        Annotated[
            float, setting("reduce the samples to plan within this [ms]", unit="ms", gt=0, le=1e4)
        ]
        | None
    ) = None


@dataclass(frozen=True)
class Setting:
    """One setting as a command line or a document shows it."""

    name: str  # "horizon", "model.drag"
    group: str  # flight, sampling, mppi, cost, model
    kind: Any  # of msgspec.inspect
    default: Any
    help: str


GROUPS = ("sampling", "mppi", "cost")  # of the planner


def settings_of(entry: SystemEntry, planner: Planner, model: Any = None) -> dict[str, Setting]:
    """Every setting by name. Defaults are those of the planner's preset and of the model, or its
    vehicle's model."""
    if model is None:
        model = entry.model_of(entry.load_vehicle(planner.vehicle))
    parts = {
        "flight": FlightSettings(),
        **{name: getattr(planner, name) for name in GROUPS},
        "model": model,
    }
    return {s.name: s for group, values in parts.items() for s in _settings(group, values, entry)}


def _settings(group: str, values: Any, entry: SystemEntry) -> Iterator[Setting]:
    """Of an instance whose values are the defaults."""
    if not is_dataclass(values) or (group == "sampling" and type(values) not in SAMPLERS.values()):
        return  # a user's own object
    prefix = "model." if group == "model" else ""
    kinds = {f.name: f.type for f in inspect.type_info(type(values)).fields}  # pyright: ignore
    for field in _fields(values):
        kind, default = kinds[field.name], getattr(values, field.name)
        text = description(kind)
        if (
            isinstance(kind, inspect.VarTupleType) and group != "flight"
        ):  # one number for each control
            kind = inspect.TupleType((kind.item_type,) * len(entry.controls))
        if field.name == "sigma":
            kind = inspect.Metadata(kind, extra={"unit": entry.control_units})
        yield Setting(prefix + field.name, group, kind, default, text)


def description(kind: Any) -> str:
    """Return the help in an annotation, "" where it has none. kind: of msgspec.inspect."""
    match kind:
        case inspect.Metadata():
            schema = kind.extra_json_schema or {}
            return schema.get("description") or description(kind.type)
        case inspect.UnionType():
            return description(unless_null(kind))
    return ""


def checked(kind: Any, name: str, given: Any) -> Any:
    """The value held against a kind of msgspec.inspect by the rules of files; a text is read as in
    a file.

    Raises SettingError.
    """
    if isinstance(bare(kind), inspect.StrType) and not isinstance(given, str | Path | None):
        raise SettingError(name, f"expected {expected(kind)}, got {given!r}")
    try:
        found = value(_node(given), kind, name)
    except Misfit as misfit:
        raise SettingError(name, _of_all(misfit, given)) from None
    return tuple(found) if isinstance(found, list) else found


def _node(given: Any) -> yaml.Node:
    """As a file would hold it in this place."""
    if isinstance(given, np.ndarray | np.generic):
        given = given.tolist()
    if isinstance(given, list | tuple):
        return yaml.SequenceNode("", [_node(x) for x in given])
    if given is None:
        return yaml.ScalarNode(NULL, "null")
    return yaml.ScalarNode(TEXT, str(given) if isinstance(given, str | Path) else repr(given))


def _fields(values: Any) -> tuple:
    """Of the settings in it that may be changed; none for what is no dataclass."""
    return tuple(f for f in fields(values) if f.name != "name") if is_dataclass(values) else ()


def _of_all(misfit: Misfit, given: Any) -> str:
    """The problem of one of several numbers, as one of all of them; without what a YAML file would
    need."""
    if "[" not in misfit.path:
        return misfit.problem.partition(" (YAML reads")[0]
    asked = misfit.problem.rpartition(", got ")[0].replace("a number", f"{len(given)} numbers")
    return f"{asked}, got " + " ".join(f"{x:g}" if isinstance(x, float) else str(x) for x in given)


def bare(kind: Any) -> Any:
    while isinstance(kind, inspect.Metadata | inspect.UnionType):
        kind = kind.type if isinstance(kind, inspect.Metadata) else unless_null(kind)
    return kind
