"""Settings: every number and choice of a flight by name, for the command line, for Python and for preset files.

A setting is a field of one of the dataclasses below; its annotation holds unit and range, the comment beside it its
help. `resolve` turns what was given into a Spec and is the one place where values are checked.
"""

from __future__ import annotations

import inspect as python_inspect
import io
import re
import tokenize
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from msgspec import Meta, inspect

from controllers.config import MPPIConfig
from controllers.costs import Cost
from controllers.presets import Planner, faults
from controllers.samplers import SAMPLERS
from quadsim.course import Course
from quadsim.course.corridor import Corridor
from quadsim.course.point_goal import PointGoal
from quadsim.files.strict_yaml import unit
from quadsim.files.yaml_values import Misfit, value
from quadsim.files.yaml_words import NULL, TEXT, did_you_mean, expected, unless_null
from quadsim.physics.plant import default_plant
from quadsim.race.flight import whole_multiple
from quadsim.race.preset_file import load_planner
from quadsim.race.spec import OwnParts, Spec
from quadsim.race.systems import SYSTEMS, SystemEntry, Task, own_system, system_of_course
from quadsim.systems import System
from quadsim.vehicle import with_thrust_to_weight

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


def settings_of(entry: SystemEntry, planner: Planner, model: Any = None) -> dict[str, Setting]:
    """Every setting by name. Defaults are those of the planner's preset and of the model, or its vehicle's model."""
    if model is None:
        model = entry.model_of(entry.load_vehicle(planner.vehicle))
    parts = {"flight": FlightSettings(), **{name: getattr(planner, name) for name in GROUPS}, "model": model}
    return {s.name: s for group, values in parts.items() for s in _settings(group, values, entry)}


def _settings(group: str, values: Any, entry: SystemEntry) -> Iterator[Setting]:
    """Of an instance whose values are the defaults."""
    if not is_dataclass(values) or (group == "sampling" and type(values) not in SAMPLERS.values()):
        return  # a user's own object
    texts, prefix = comments(type(values)), "model." if group == "model" else ""
    kinds = {f.name: f.type for f in inspect.type_info(type(values)).fields}  # pyright: ignore
    for field in _fields(values):
        kind, default = kinds[field.name], getattr(values, field.name)
        if isinstance(kind, inspect.VarTupleType):  # one number for each control
            kind = inspect.TupleType((kind.item_type,) * len(entry.controls))
        if field.name == "sigma":
            kind = inspect.Metadata(kind, extra={"unit": entry.control_units})
        yield Setting(prefix + field.name, group, kind, default, texts.get(field.name, ""))


@cache
def comments(cls: type) -> dict[str, str]:
    """Field -> the comment at the end of its line in the source."""
    found = {}
    for token in tokenize.generate_tokens(io.StringIO(python_inspect.getsource(cls)).readline):
        field = re.match(r"    (\w+): .*", token.line)
        if field and token.type == tokenize.COMMENT:
            found[field[1]] = token.string.lstrip("# ")
    return found


def resolve(course: Any = None, **given: Any) -> Spec:
    """The Spec of these settings; what is not given comes from the preset, the course and the vehicle.

    course: a name, a FILE.yaml, or a course object. A sampler, cost, system, plant, controller or referee may be an
    object of the user's own. Raises SettingError, FileError.
    """
    if isinstance(given.get("system"), System):
        return _of_own_system(**given)
    own = OwnParts(**{role: given.pop(role) for role in ("cost", "controller", "referee") if role in given})
    if "plant" in given and not isinstance(given["plant"], str | None):
        own = replace(own, plant=given.pop("plant"))
    sampling = sampler_object(given["sampler"]) if "sampler" in given else None
    if sampling is not None:
        given["sampler"] = sampler_name(sampling) if type(sampling) in SAMPLERS.values() else FlightSettings.sampler
    if "system" not in given and course is not None:
        given["system"] = _system_of(course)
    f = _flight_settings(given)
    system = f.system or "quadrotor"
    entry = SYSTEMS[system]
    preset = f.preset or entry.default_preset
    planner = load_planner(preset, f.sampler, entry.presets, entry.control_units)
    if sampling is not None:
        planner = replace(planner, sampling=sampling)
    vehicle = entry.load_vehicle(f.vehicle or planner.vehicle)
    if f.thrust_to_weight:
        vehicle = with_thrust_to_weight(vehicle, f.thrust_to_weight)
    planner = replace(planner, vehicle=vehicle.name)
    planner, model = _planned(planner, entry.model_of(vehicle), given, entry)
    where = entry.load_course(str(course or entry.default_course)) if isinstance(course, str | Path | None) else course
    plant_dt = f.plant_dt or entry.plant_dt or planner.mppi.dt
    laps = f.laps or where.laps
    try:
        whole_multiple(planner.mppi.dt, plant_dt)
    except ValueError as error:  # "dt: expected ..."
        raise SettingError(*str(error).split(": ", 1)) from None
    return Spec(
        system=system,
        course=where,
        vehicle=vehicle,
        sampler=sampler_name(planner.sampling),
        preset=preset,
        planner=planner,
        model=model,
        seed=f.seed,
        laps=laps,
        timeout=f.timeout or entry.timeout(where, laps),
        penalties=f.penalties,
        plant_dt=plant_dt,
        plant=f.plant or default_plant() if system == "quadrotor" else "model",
        randomize=f.randomize,
        clock=f.clock,
        deadline_ms=f.deadline_ms,
        host={"threads": f.threads},
        own=own,
    )


def checked(kind: Any, name: str, given: Any) -> Any:
    """The value held against a kind of msgspec.inspect by the rules of files; a text is read as in a file.

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


def sampler_object(sampler: Any) -> Any:
    """A sampler that was given as an object or as "package.module:Class"; None for the name of a registered one."""
    if not isinstance(sampler, str):
        return sampler
    if ":" not in sampler:
        if sampler not in SAMPLERS:
            raise SettingError("sampler", f"no sampler {sampler!r}: {did_you_mean(sampler, SAMPLERS)}")
        return None
    module, _, name = sampler.partition(":")
    try:
        found = getattr(import_module(module), name)
        return found() if isinstance(found, type) else found
    except (ImportError, AttributeError, TypeError) as error:
        raise SettingError(
            "sampler", f"expected package.module:Class without arguments, got {sampler!r}: {error}"
        ) from None


def sampler_name(sampler: Any) -> str:
    """As registered, or the class name of a user's own."""
    return next((name for name, cls in SAMPLERS.items() if type(sampler) is cls), type(sampler).__name__)


def _flight_settings(given: dict[str, Any]) -> FlightSettings:
    """Those of `given`, which are taken out of it."""
    kinds = {f.name: f.type for f in inspect.type_info(FlightSettings).fields}  # pyright: ignore
    return FlightSettings(**{k: checked(kind, k, given.pop(k)) for k, kind in kinds.items() if k in given})


def _system_of(course: Any) -> str:
    if isinstance(course, str | Path):
        return system_of_course(str(course))
    return {Course: "quadrotor", Corridor: "offroad", PointGoal: "double_integrator"}[type(course)]


def _planned(planner: Planner, model: Any, given: Mapping[str, Any], entry: SystemEntry) -> tuple[Planner, Any]:
    """The preset's planner and the vehicle's nominal model with the settings that were given."""
    known = settings_of(entry, planner, model)
    changes: dict[str, dict] = {group: {} for group in (*GROUPS, "model")}
    for name, said in given.items():
        if name not in known:
            of = [s for s, cls in SAMPLERS.items() if name in cls.__dataclass_fields__]
            why = f"of {' and '.join(of)} sampling only" if of else f"no such setting, {did_you_mean(name, known)}"
            raise SettingError(name, why)
        changes[known[name].group][name.removeprefix("model.")] = checked(known[name].kind, name, said)
    groups = {group: replace(getattr(planner, group), **changes[group]) for group in GROUPS if changes[group]}
    planner = replace(planner, **groups)
    _check_channels(planner.sampling, entry)
    for path, problem in faults(planner):
        raise SettingError(path.partition(".")[2], problem)
    return planner, replace(model, **changes["model"]) if changes["model"] else model


def _of_own_system(system: System, cost: Any, sampler: Any, start: Any, timeout: float, **given: Any) -> Spec:
    """A system of the user's own, which is its own world; the flight ends after `timeout` [s]."""
    if not isinstance(cost, Cost):
        raise SettingError("cost", f"expected a controllers.costs.Cost for a system of one's own, got {cost!r}")
    own = OwnParts(**{role: given.pop(role) for role in ("plant", "controller", "referee") if role in given}, cost=cost)
    place = Task(system.name)
    entry = own_system(system, tuple(map(float, start)))
    f = _flight_settings(given)
    planner, _ = _planned(Planner(system.name, sampler, MPPIConfig(dt=system.dt), None), (), given, entry)
    return Spec(
        system=system.name,
        course=place,
        vehicle=place,
        sampler=sampler_name(sampler),
        preset="own",
        planner=planner,
        model=system,
        seed=f.seed,
        laps=1,
        timeout=timeout,
        penalties=False,
        plant_dt=f.plant_dt or system.dt,
        randomize=f.randomize,
        clock=f.clock,
        deadline_ms=f.deadline_ms,
        host={"threads": f.threads},
        own=replace(own, system=entry),
    )


def _fields(values: Any) -> tuple:
    """Of the settings in it that may be changed; none for what is no dataclass."""
    return tuple(f for f in fields(values) if f.name != "name") if is_dataclass(values) else ()


def _check_channels(sampling: Any, entry: SystemEntry) -> None:
    """One number for each control channel."""
    wanted = len(entry.controls)
    for field in _fields(sampling):
        numbers = getattr(sampling, field.name)
        if isinstance(numbers, tuple) and len(numbers) != wanted:
            units = entry.control_units if field.name == "sigma" else "1"
            came = " ".join(f"{x:g}" for x in numbers)
            raise SettingError(field.name, f"expected {wanted} numbers [{units}], got {came}")


def _of_all(misfit: Misfit, given: Any) -> str:
    """The problem of one of several numbers, as one of all of them; without what a YAML file would need."""
    if "[" not in misfit.path:
        return misfit.problem.partition(" (YAML reads")[0]
    asked = misfit.problem.rpartition(", got ")[0].replace("a number", f"{len(given)} numbers")
    return f"{asked}, got " + " ".join(f"{x:g}" if isinstance(x, float) else str(x) for x in given)


def bare(kind: Any) -> Any:
    while isinstance(kind, inspect.Metadata | inspect.UnionType):
        kind = kind.type if isinstance(kind, inspect.Metadata) else unless_null(kind)
    return kind
