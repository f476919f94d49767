"""Spec: one flight, whole. The same record builds the flight and is stored with its run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from controllers.presets import Planner, faults
from controllers.samplers import SAMPLERS
from quadsim.course import Course
from quadsim.course.corridor import Corridor
from quadsim.course.point_goal import PointGoal
from quadsim.files.yaml_words import did_you_mean
from quadsim.physics.domain_randomization import draw
from quadsim.race.flight import whole_multiple
from quadsim.race.preset_file import load_planner
from quadsim.race.settings import GROUPS, FlightSettings, SettingError, checked, kinds_of, settings_of
from quadsim.race.systems import SYSTEMS, SystemEntry, own_system, system_of_course
from quadsim.systems import System
from quadsim.vehicle import with_thrust_to_weight


@dataclass(frozen=True)
class OwnParts:
    """Objects of the user's own in place of named parts. A run keeps what they are called, not what they do.

    plant, controller, referee: an object for one flight, or a class or function that is called with the Spec.
    cost: a Cost, or a function of the default Cost that returns one.
    """

    system: SystemEntry | None = None
    cost: Any = None
    plant: Any = None
    controller: Any = None
    referee: Any = None

    @classmethod
    def taken(cls, settings: dict[str, Any]) -> OwnParts:
        """Taken out of the settings."""
        if isinstance(settings.get("system"), System):
            return cls._with_system(settings)
        named = "plant" in settings and isinstance(settings["plant"], str | None)
        roles = [f.name for f in fields(cls) if f.name != "system" and not (f.name == "plant" and named)]
        return cls(**{role: settings.pop(role) for role in roles if role in settings})

    @classmethod
    def _with_system(cls, settings: dict[str, Any]) -> OwnParts:
        """A system is its own world, from `start` on; it comes with its cost and its sampler."""
        system, missing = settings.pop("system"), [k for k in ("cost", "sampler", "start") if k not in settings]
        if missing:
            raise SettingError(missing[0], f"missing, expected one for the system {system.name!r}")
        entry = own_system(system, tuple(map(float, settings.pop("start"))), settings["sampler"])
        return replace(cls.taken(settings), system=entry)

    def described(self) -> dict[str, dict]:
        """{role: {class, parameters}} of those that are given, as JSON."""
        given = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "system"}
        return {role: describe(part) for role, part in given.items() if part is not None}


@dataclass(frozen=True)
class Spec:
    """One flight, whole. Same spec, same machine: the same Run to the last bit.

    Made by `Spec.of("split_s_swift", sampler="gaussian", horizon=120)`; every setting of `race fly` is a keyword.
    """

    system: str  # of SYSTEMS
    course: Any  # Course, Corridor or PointGoal
    vehicle: Any
    sampler: str  # name, or the class name of the user's own
    preset: str
    planner: Planner
    model: Any  # the planner's model of the vehicle
    seed: int
    laps: int
    timeout: float  # [s]
    penalties: bool
    plant_dt: float  # [s]
    plant: str = "model"  # of physics.plant.PLANTS; model: the system is its own world
    randomize: float = 0.0  # size of domain randomization and disturbance, see quadsim.physics.domain_randomization
    clock: str = "simulated"  # of CLOCKS
    deadline_ms: float | None = None  # shrink the samples so that a plan takes no longer
    host: dict = field(default_factory=dict)  # what must not change a flight: threads, folders
    own: OwnParts = OwnParts()

    @classmethod
    def of(cls, course: Any = None, **settings: Any) -> Spec:
        """The spec of these settings; what is not given comes from the preset, the course and the vehicle.

        course: a name, a FILE.yaml, or a course object. A sampler, cost, system, plant, controller or referee may be
        an object of the user's own. Raises SettingError, FileError: one line that names the setting or the file.
        """
        own = OwnParts.taken(settings)
        sampling = own.system.sampling if own.system else sampler_object(settings.get("sampler"))
        if sampling is not None:
            settings["sampler"] = sampler_name(sampling)
        if not own.system and course is not None:
            settings.setdefault("system", system_of(course))
        kinds = kinds_of(FlightSettings)
        f = FlightSettings(**{k: checked(kind, k, settings.pop(k)) for k, kind in kinds.items() if k in settings})
        entry = own.system or SYSTEMS[f.system or "quadrotor"]
        planner, vehicle = _preset(f, entry, sampling)
        planner, model = _planned(planner, entry.model_of(vehicle), settings, entry)
        where: Any = entry.load_course(str(course or entry.default_course)) if _is_name(course) else course
        laps, plant_dt = f.laps or where.laps, f.plant_dt or entry.plant_dt or planner.mppi.dt
        try:
            whole_multiple(planner.mppi.dt, plant_dt)
        except ValueError as error:  # "dt: expected ..."
            raise SettingError(*str(error).split(": ", 1)) from None
        return cls(
            system=entry.name,
            course=where,
            vehicle=vehicle,
            sampler=sampler_name(planner.sampling),
            preset=f.preset or entry.default_preset,
            planner=planner,
            model=model,
            laps=laps,
            timeout=f.timeout or entry.timeout(where, laps),
            plant=f.plant or entry.default_plant(),
            plant_dt=plant_dt,
            host={"threads": f.threads},
            own=own,
            **{name: getattr(f, name) for name in ("seed", "penalties", "randomize", "clock", "deadline_ms")},
        )

    @property
    def entry(self) -> SystemEntry:
        return self.own.system or SYSTEMS[self.system]

    @property
    def streams(self) -> tuple[np.random.SeedSequence, ...]:
        return self.entry.streams(self.seed)

    def record(self) -> dict:
        """The JSON that a run keeps."""
        kept = {f.name: _plain(getattr(self, f.name)) for f in fields(self) if f.name not in ("course", "own")}
        kept |= {"course": self.course.name, "course_text": self.course.text}
        kept["variation"] = asdict(draw(self.streams[1], self.randomize if self.system == "quadrotor" else 0.0))
        own = self.own.described()
        if type(self.planner.sampling) not in SAMPLERS.values():
            own["sampler"] = describe(self.planner.sampling)
        if self.own.system:
            own["system"] = {"states": list(self.entry.states), "controls": list(self.entry.controls)}
        return kept | ({"own": own} if own else {})


def sampler_object(sampler: Any) -> Any:
    """A sampler that was given as an object or as "package.module:Class"; None for the name of a registered one."""
    if sampler is not None and not isinstance(sampler, str):
        if not hasattr(sampler, "sample") and not hasattr(sampler, "build"):
            raise SettingError("sampler", f"expected a name or an object with a method `sample`, got {sampler!r}")
        return sampler
    if sampler is None or ":" not in sampler:
        if sampler not in (None, *SAMPLERS):
            raise SettingError("sampler", f"no sampler {sampler!r}: {did_you_mean(sampler, SAMPLERS)}")
        return None
    module, _, name = sampler.partition(":")
    try:
        found = getattr(import_module(module), name)
        return found() if isinstance(found, type) else found
    except (ImportError, AttributeError, TypeError) as error:
        wanted = f"expected package.module:Class without arguments, got {sampler!r}"
        raise SettingError("sampler", f"{wanted}: {error}") from None


def sampler_name(sampler: Any) -> str:
    """As registered, or the class name of a user's own."""
    return next((name for name, cls in SAMPLERS.items() if type(sampler) is cls), type(sampler).__name__)


def system_of(course: Any) -> str:
    """The system that a course is made for."""
    if isinstance(course, str | Path):
        return system_of_course(str(course))
    return {Course: "quadrotor", Corridor: "offroad", PointGoal: "double_integrator"}[type(course)]


def _is_name(course: Any) -> bool:
    return course is None or isinstance(course, str | Path)


def _preset(f: FlightSettings, entry: SystemEntry, sampling: Any) -> tuple[Planner, Any]:
    """The preset's planner with the vehicle that is flown; a user's own sampler has the other numbers of `colored`."""
    registered = sampling is None or type(sampling) in SAMPLERS.values()
    sampler = "own" if entry.sampling else f.sampler if registered else FlightSettings.sampler
    planner = load_planner(f.preset or entry.default_preset, sampler, entry.presets)
    vehicle = entry.load_vehicle(f.vehicle or planner.vehicle)
    if f.thrust_to_weight:
        vehicle = with_thrust_to_weight(vehicle, f.thrust_to_weight)
    return replace(planner, vehicle=vehicle.name, sampling=sampling or planner.sampling), vehicle


def _planned(planner: Planner, model: Any, given: Mapping[str, Any], entry: SystemEntry) -> tuple[Planner, Any]:
    """The preset's planner and the vehicle's nominal model with the settings that were given."""
    known = settings_of(planner, model, tuple(entry.controls.values()))
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


def _check_channels(sampling: Any, entry: SystemEntry) -> None:
    """One number for each control channel."""
    wanted = len(entry.controls)
    for name in getattr(sampling, "__dataclass_fields__", ()):
        numbers = getattr(sampling, name)
        if isinstance(numbers, tuple) and len(numbers) != wanted:
            units = ", ".join(entry.controls.values()) if name == "sigma" else "1"
            came = " ".join(f"{x:g}" for x in numbers)
            raise SettingError(name, f"expected {wanted} numbers [{units}], got {came}")


def describe(part: Any) -> dict:
    """{class, parameters} of a user's object, as JSON."""
    kind = part if is_maker(part) else type(part)
    values = {} if kind is part else getattr(part, "__dict__", {})
    return {"class": f"{kind.__module__}.{kind.__qualname__}", "parameters": {k: _plain(v) for k, v in values.items()}}


def is_maker(part: Any) -> bool:
    """A class or a function, which is called with the spec."""
    return isinstance(part, type | FunctionType)


def _plain(value: Any) -> Any:
    """As JSON holds it; of other objects the class and its parameters."""
    if isinstance(value, str | int | float | bool) or value is None:
        return value
    if isinstance(value, dict):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    return describe(value)
