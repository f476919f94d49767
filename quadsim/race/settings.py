"""Settings: every number and choice of a flight by name, for the command line, for Python and for preset files.

A setting is a field of a dataclass; its annotation holds unit and range, the comment beside it its help.
`checked` is the one place where values are judged, by the rules of files.
"""

from __future__ import annotations

import inspect as python_inspect
import io
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from msgspec import Meta, inspect

from controllers.presets import Planner
from quadsim.files.strict_yaml import parse, unit
from quadsim.files.yaml_values import Misfit, value
from quadsim.files.yaml_words import unless_null

Count = Annotated[int, Meta(ge=1)]


class SettingError(ValueError):
    """A setting that cannot be used: its name, what was expected with its unit, what came."""

    def __init__(self, name: str, problem: str):
        super().__init__(f"{name}: {problem}" if name else problem)
        self.name, self.problem = name, problem


@dataclass(frozen=True)
class FlightSettings:
    """What to fly; None: what the course, the vehicle or the preset says."""

    system: Literal["quadrotor", "offroad", "double_integrator"] | None = None  # left out: the course's
    sampler: str = "colored"  # of the perturbations
    preset: str | None = None  # of every number that is not given: a name or a FILE.yaml
    vehicle: str | None = None  # see `race vehicles`, or a FILE.yaml
    thrust_to_weight: Annotated[float, Meta(gt=1, le=20)] | None = None  # stronger or weaker propellers
    laps: Annotated[int, Meta(ge=1, le=1000)] | None = None  # from the standing start
    seed: Annotated[int, Meta(ge=0, le=10**9)] = 0  # of everything random
    randomize: Annotated[float, Meta(ge=0, le=3)] = 0.0  # size of domain randomization: start, vehicle, gusts
    timeout: Annotated[float, unit("s", gt=0, le=1e5)] | None = None  # of the flight [s]
    threads: Count | None = None  # left out: every core; results do not depend on it
    penalties: bool = False  # a hit costs 3 s instead of ending the flight
    plant: Literal["bullet", "rigid"] | None = None  # rigid body: PyBullet's or our own
    plant_dt: Annotated[float, unit("s", gt=0, le=0.02)] | None = None  # step of the simulated world [s]
    clock: Literal["simulated", "wall"] = "simulated"  # wall: the world does not wait for the planner
    deadline_ms: Annotated[float, unit("ms", gt=0, le=1e4)] | None = None  # shrink the samples to hold it [ms]


@dataclass(frozen=True)
class Setting:
    """One setting as a command line or a document shows it."""

    name: str  # "horizon", "model.drag"
    group: str  # flight, sampling, mppi, cost, model
    kind: Any  # of msgspec.inspect
    default: Any
    help: str


GROUPS = ("sampling", "mppi", "cost")  # of the planner


def settings_of(planner: Planner, model: Any) -> dict[str, list[Setting]]:
    """Every setting by group: flight, sampling, mppi, cost, model. Defaults are those of the planner and the model."""
    parts = {"flight": FlightSettings(), **{name: getattr(planner, name) for name in GROUPS}, "model": model}
    return {group: list(_settings(group, values)) for group, values in parts.items()}


def _settings(group: str, values: Any) -> Iterator[Setting]:
    """Of an instance whose values are the defaults."""
    texts, prefix = comments(type(values)), "model." if group == "model" else ""
    kinds = {f.name: f.type for f in inspect.type_info(type(values)).fields}  # pyright: ignore
    for field in setting_fields(values):
        default = getattr(values, field.name)
        yield Setting(prefix + field.name, group, kinds[field.name], default, texts.get(field.name, ""))


@cache
def comments(cls: type) -> dict[str, str]:
    """Field -> the comment at the end of its line in the source."""
    found, name = {}, ""
    for token in tokenize.generate_tokens(io.StringIO(python_inspect.getsource(cls)).readline):
        if token.type == tokenize.NAME and token.start[1] == 4 and token.line.lstrip().startswith(f"{token.string}:"):
            name = token.string
        elif token.type == tokenize.COMMENT and name:
            found[name], name = token.string.lstrip("# "), ""
    return found


def setting_fields(values: Any) -> tuple:
    """The fields of a dataclass's instance that are settings; none of what is no dataclass."""
    return tuple(f for f in fields(values) if f.name != "name") if is_dataclass(values) else ()


def checked(cls: type, name: str, given: Any, units: str = "") -> Any:
    """The value of a dataclass's field, held against its annotation. Raises SettingError."""
    kinds = {f.name: f.type for f in inspect.type_info(cls).fields}  # pyright: ignore
    return checked_kind(kinds[name], name, given, units)


def checked_kind(kind: Any, name: str, given: Any, units: str = "") -> Any:
    """The value held against a kind of msgspec.inspect, by the rules of files. Raises SettingError."""
    if isinstance(given, np.ndarray | np.generic):
        given = given.tolist()
    text = yaml.safe_dump({name: _listed(given)}, default_flow_style=True, width=float("inf"))
    try:
        found = value(parse(text, "").root.value[0][1], kind, name, units)
    except Misfit as misfit:
        raise SettingError(name, _of_all(misfit, given)) from None
    return tuple(found) if isinstance(found, list) else found


def _of_all(misfit: Misfit, given: Any) -> str:
    """The problem of one of several numbers, as one of all of them."""
    if "[" not in misfit.path:
        return misfit.problem
    asked = misfit.problem.rpartition(", got ")[0].replace("a number", f"{len(given)} numbers")
    return f"{asked}, got " + " ".join(x if isinstance(x, str) else f"{x:g}" for x in given)


def bare(kind: Any) -> Any:
    while isinstance(kind, inspect.Metadata | inspect.UnionType):
        kind = kind.type if isinstance(kind, inspect.Metadata) else unless_null(kind)
    return kind


def _listed(given: Any) -> Any:
    return [_listed(x) for x in given] if isinstance(given, list | tuple) else given
