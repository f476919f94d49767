"""What was given as settings, by name, becomes the fields of a Spec: the one place where values are
checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from msgspec import inspect

from controllers.costs.reference import ReferenceWeights
from controllers.learned.pilot import Pilot, load_pilot
from controllers.presets import Planner, faults
from controllers.samplers import SAMPLERS
from quadsim.course import Course
from quadsim.files.yaml_words import did_you_mean
from quadsim.physics.plant import default_plant
from quadsim.race.flight import whole_multiple
from quadsim.sensing import PERFECT, Sensing, load_sensing
from quadsim.spec.own_parts import (
    own_parts,
    sampler_name,
    sampler_object,
)
from quadsim.spec.preset_file import load_planner
from quadsim.spec.reference import stored_reference
from quadsim.spec.settings import GROUPS, FlightSettings, SettingError, checked, settings_of
from quadsim.spec.systems import SYSTEMS, SystemEntry, system_of_course
from quadsim.vehicle import with_thrust_to_weight


def resolve(course: Any = None, **given: Any) -> dict[str, Any]:
    """The fields of a Spec with these settings; what is not given comes from preset, course and
    vehicle.

    course: a name, a FILE.yaml, or a course object. A sampler, cost, system, plant, controller or
    referee may be an object of the user's own. Raises SettingError, FileError.
    """
    own = own_parts(given)
    sampling = sampler_object(given["sampler"]) if "sampler" in given else None
    if sampling is not None:
        given["sampler"] = (
            sampler_name(sampling)
            if type(sampling) in SAMPLERS.values()
            else FlightSettings.sampler
        )
    if "system" not in given and course is not None:
        given["system"] = _system_of(course)
    f = _flight_settings(given)
    system = f.system or "quadrotor"
    entry = SYSTEMS[system]
    base, vehicle, pilot = _preset(f, entry, sampling)
    planner, model = _planned(base, entry.model_of(vehicle), given, entry)
    where = (
        entry.load_course(str(course or entry.default_course))
        if isinstance(course, str | Path | None)
        else course
    )
    plant_dt = f.plant_dt or entry.plant_dt or planner.mppi.dt
    laps, sensing = f.laps or where.laps, _sensing(f, system)
    _check_reference(planner.cost, where, vehicle, laps, f)
    _check_periods(planner.mppi.dt, plant_dt)
    return _as_given(f) | {
        "system": system,
        "course": where,
        "vehicle": vehicle,
        "sampler": "pilot" if pilot else sampler_name(planner.sampling),
        "preset": f.preset or entry.default_preset,
        "planner": planner,
        "model": model,
        "laps": laps,
        "pilot": _check_pilot(pilot, vehicle, planner.mppi.dt),
        "timeout": f.timeout or entry.timeout(where, laps),
        "penalties": f.penalties,
        "plant_dt": plant_dt,
        "plant": f.plant or default_plant() if system == "quadrotor" else "model",
        "sensing": sensing,
        "displace_gates": f.displace_gates,
        "view_weight": _view_weight(f, base, sensing),
        "own": own,
    }


def _view_weight(f: FlightSettings, base: Planner, sensing: Sensing | None) -> float:
    """Where gates may stand off the map, the camera has to find them; else the vehicle is faster
    without yaw."""
    if not (sensing and sensing.camera):
        return 0.0
    if f.view_weight is None:
        return base.view_weight if f.displace_gates else 0.0
    return f.view_weight


def _check_periods(dt: float, plant_dt: float) -> None:
    """Raises SettingError."""
    try:
        whole_multiple(dt, plant_dt)
    except ValueError as error:  # "dt: expected ..."
        raise SettingError(*str(error).split(": ", 1)) from None


def _check_reference(
    weights: Any, course: Course, vehicle: Any, laps: int, f: FlightSettings
) -> None:
    """Whether there is one to follow, where one is followed. Raises SettingError, FileError."""
    if not isinstance(weights, ReferenceWeights):
        return
    if f.view_weight or f.displace_gates:
        name = "view_weight" if f.view_weight else "displace_gates"
        raise SettingError(
            name,
            "expected 0 for a preset that follows a reference, which knows no other gates or views",
        )
    stored_reference(course, vehicle, laps, weights)


def _check_pilot(pilot: Pilot | None, vehicle: Any, dt: float) -> Pilot | None:
    if pilot:
        pilot.check(vehicle.name, dt)
    return pilot


def _pilot(f: FlightSettings, entry: SystemEntry) -> Pilot | None:
    if f.pilot is None:
        return None
    if entry.name != "quadrotor":
        raise SettingError(
            "pilot", f"expected a quadrotor for a learned pilot, got the system {entry.name}"
        )
    return load_pilot(f.pilot)


def _preset(
    f: FlightSettings, entry: SystemEntry, sampling: Any
) -> tuple[Planner, Any, Pilot | None]:
    """The preset's planner, with a user's own sampler where there is one, the vehicle that is
    flown, the pilot."""
    pilot = _pilot(f, entry)
    planner = load_planner(
        f.preset or entry.default_preset, f.sampler, entry.presets, entry.control_units
    )
    vehicle = entry.load_vehicle(f.vehicle or (pilot.about.vehicle if pilot else planner.vehicle))
    if f.thrust_to_weight:
        vehicle = with_thrust_to_weight(vehicle, f.thrust_to_weight)
    sampling = planner.sampling if sampling is None else sampling
    return replace(planner, vehicle=vehicle.name, sampling=sampling), vehicle, pilot


def _sensing(f: FlightSettings, system: str) -> Sensing | None:
    """The sensors that are flown with, None for the true state."""
    for name, given in (
        ("sensing", f.sensing != PERFECT),
        ("displace_gates", f.displace_gates > 0.0),
    ):
        if given and system != "quadrotor":
            raise SettingError(name, f"of quadrotors only, got the system {system}")
    sensing = load_sensing(f.sensing)
    if f.view_weight and not sensing.camera:
        raise SettingError("view_weight", f"expected a sensing with a camera, got {f.sensing}")
    return None if sensing.exact else sensing


def _flight_settings(given: dict[str, Any]) -> FlightSettings:
    """Those of `given`, which are taken out of it."""
    kinds = {f.name: f.type for f in inspect.type_info(FlightSettings).fields}  # pyright: ignore
    return FlightSettings(
        **{k: checked(kind, k, given.pop(k)) for k, kind in kinds.items() if k in given}
    )


def _as_given(f: FlightSettings) -> dict[str, Any]:
    """The fields that are settings as they stand."""
    same = ("seed", "randomize", "clock", "deadline_ms")
    return {name: getattr(f, name) for name in same} | {"host": {"threads": f.threads}}


def _system_of(course: Any) -> str:
    if isinstance(course, str | Path):
        return system_of_course(str(course))
    systems = {Course: "quadrotor"}
    if type(course) not in systems:
        raise SettingError("course", f"expected a name, a FILE.yaml or a Course, got {course!r}")
    return systems[type(course)]


def _planned(
    planner: Planner, model: Any, given: Mapping[str, Any], entry: SystemEntry
) -> tuple[Planner, Any]:
    """The preset's planner and the vehicle's nominal model with the settings that were given."""
    known = settings_of(entry, planner, model)
    changes: dict[str, dict] = {group: {} for group in (*GROUPS, "model")}
    for name, said in given.items():
        if name not in known:
            of = [s for s, cls in SAMPLERS.items() if name in cls.__dataclass_fields__]
            why = (
                f"of {' and '.join(of)} sampling only"
                if of
                else f"no such setting, {did_you_mean(name, known)}"
            )
            raise SettingError(name, why)
        changes[known[name].group][name.removeprefix("model.")] = checked(
            known[name].kind, name, said
        )
    groups = {
        group: replace(getattr(planner, group), **changes[group])
        for group in GROUPS
        if changes[group]
    }
    planner = replace(planner, **groups)
    _check_channels(planner.sampling, entry)
    for path, problem in faults(planner):
        raise SettingError(path.partition(".")[2], problem)
    return planner, replace(model, **changes["model"]) if changes["model"] else model


def _check_channels(sampling: Any, entry: SystemEntry) -> None:
    """One number for each control, where the sampler is one of SAMPLERS."""
    numbers = vars(sampling) if type(sampling) in SAMPLERS.values() else {}
    for name in ("sigma", "gamma"):
        given = numbers.get(name, entry.controls)
        if len(given) != len(entry.controls):
            units = f" [{entry.control_units}]" if name == "sigma" else ""
            raise SettingError(
                name,
                f"expected {len(entry.controls)} numbers{units}, got {' '.join(map(str, given))}",
            )
