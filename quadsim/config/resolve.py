"""Resolve the settings of a flight to its parts, by reading files and finding defaults."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

from quadsim.config.checks import check_numbers, check_type
from quadsim.config.own import own_controller, own_sampler
from quadsim.config.presets import PresetSource
from quadsim.config.settings import (
    SETTINGS,
    FlightSettings,
    Group,
    Setting,
    SettingError,
    is_optional,
)
from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.derived import Scale
from quadsim.controllers.presets import Planner, with_period
from quadsim.controllers.samplers import SAMPLERS, Colored, is_registered, sampler_name
from quadsim.course import Course
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.files.values import checked
from quadsim.files.yaml_errors import did_you_mean, shown_value
from quadsim.firmware.text import Text, read_text, shipped_configuration
from quadsim.physics.domain_randomization import Displacement
from quadsim.physics.randomization_file import RandomizationRanges
from quadsim.sensing import PERFECT, Sensing
from quadsim.vehicle import Vehicle

DEFAULT_COURSE = "split_s_swift"
# What a flight of manoeuvres has unless it is given
EXCITATION: Mapping[str, Any] = {
    "course": Path(__file__).parent / "excitation_box.yaml",
    "sensing": "mocap",
    "record_sensing": True,
    # The manoeuvres take a minute; the way out has no more than this [s].
    "timeout": 75.0,
}
# Keywords that take an object and are not settings.
OBJECTS = ("course", "planner", "model", "referee", "cost", "terms")
KEYWORDS = (*SETTINGS, *OBJECTS)
# Settings that take an object in place of a name
OBJECT_SETTINGS = (
    *("sampler", "pilot", "controller", "vehicle", "sensing", "randomization", "plant", "preset"),
    *("betaflight", "competition"),
)
# Physics step with the firmware: its gyro and its link are exchanged in each [s]
FIRMWARE_STEP = 1e-3

T = TypeVar("T")


def check_names(given: Mapping[str, Any]) -> None:
    """Check that each name is the name of a setting. Raises SettingError."""
    for name in given:
        if name not in KEYWORDS:
            raise SettingError(name, f"no such setting, {did_you_mean(name, KEYWORDS)}")


def with_excitation(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the settings, with the defaults of manoeuvres if the flight is one of manoeuvres.

    Raises:
        SettingError: another controller is given, too.
    """
    if not checked("excite", given.get("excite") or False, SETTINGS["excite"].kind):
        return given
    for name in ("pilot", "controller"):
        if given.get(name) is not None:
            raise SettingError(name, "expected none beside excite, whose manoeuvres fly")
    chosen = {name: value for name, value in given.items() if value is not None}
    of_no_sensors = {"record_sensing": False} if chosen.get("sensing") == PERFECT else {}
    return {**EXCITATION, **of_no_sensors, **chosen}


def flight_settings(given: Mapping[str, Any]) -> FlightSettings:
    """Return the flight's settings except those given as objects. Raises SettingError."""
    values: dict[str, Any] = {}
    for f in fields(FlightSettings):
        value = given.get(f.name)
        is_object = f.name in OBJECT_SETTINGS
        if value is None or (is_object and not isinstance(value, str | Path)):
            continue
        if f.name in ("term", "fault") and isinstance(value, str):
            value = (value,)
        values[f.name] = checked(f.name, value, SETTINGS[f.name].kind)
    # The firmware has a physics step of its own.
    if values.get("flight_controller", "ideal") != "ideal":
        values.setdefault("plant_dt", FIRMWARE_STEP)
    return FlightSettings(**values)


@dataclass(frozen=True)
class PlannerSource:
    """The source of a planner's numbers before settings change them: a preset, or a planner."""

    # a planner with numbers of its own; None: the preset's
    planner: Planner | None
    preset: PresetSource
    sampler: str
    # the user's own sampler, which gets the other numbers of `sampler`
    sampling: Any
    firmware: bool

    def at(self, scale: Scale | None) -> Planner:
        """Return the planner.

        Args:
            scale: scale of the flight, from which numbers of the preset follow; None: that of the
                preset's reference.

        Raises:
            FileError: there is no such preset, or its file is not a preset.
        """
        if self.planner is not None:
            return self.planner
        found = self.preset.planner(self.sampler, self.firmware, scale)
        return found if self.sampling is None else replace(found, sampling=self.sampling)


class Loader:
    """The settings of a flight, and the objects that replace names among them.

    Each file is read only once, because `Spec.but` changes the objects that were read.

    Attributes:
        given: the settings.
        read: the objects, by names of settings.
    """

    def __init__(self, given: Mapping[str, Any]):
        """Begin with settings, before any file is read.

        Args:
            given: the settings.
        """
        self.given = given
        self.read: dict[str, Any] = {}

    def part(self, name: str, kind: type[T], load: Callable[[str], T], default: str) -> T:
        """Return a part that was given by name, by path or as an object, or else the default.

        Args:
            name: name of the setting.
            kind: type of the object.
            load: function that reads the part of a name or path; raises FileError.
            default: name to load if no part is given.

        Raises:
            SettingError: the part is neither a name nor an object of its type.
        """
        found = self.given_part(name, kind, load)
        return load(default) if found is None else found

    def given_part(self, name: str, kind: type[T], load: Callable[[str], T]) -> T | None:
        """Return a part if it was given, else None; see `part`. Raises SettingError."""
        found = self.given.get(name)
        if found is None:
            return None
        if isinstance(found, kind):
            check_numbers(name, found)
            return found
        if not isinstance(found, str | Path):
            wanted = f"expected a name, a FILE.yaml or a {kind.__name__}"
            raise SettingError(name, f"{wanted}, got {shown_value(found)}")
        self.read[name] = load(str(found))
        return self.read[name]

    def configuration(self, flight: FlightSettings, vehicle: Vehicle) -> Text | None:
        """Return the given or the vehicle's configuration of the firmware, None if there is none.

        Raises:
            SettingError: the setting is not a file.
            FileError: the file cannot be read.
        """
        own = self.given.get("betaflight")
        if isinstance(own, Text):
            return own
        if own is not None:
            if not isinstance(own, str | Path):
                raise SettingError("betaflight", f"expected a FILE.txt, got {shown_value(own)}")
            self.read["betaflight"] = read_text(Path(own))
            return self.read["betaflight"]
        if flight.flight_controller == "ideal":
            return None
        return shipped_configuration(vehicle)

    def controller(self) -> Any:
        """Return the user's own controller if it was given, else None. Raises SettingError."""
        given = self.given.get("controller")
        if given is None:
            return None
        self.read["controller"] = own_controller(given)
        return self.read["controller"]

    def planner_source(self, flight: FlightSettings) -> PlannerSource:
        """Return the source of the planner.

        Raises:
            SettingError: a planner is given together with a sampler or a preset, or a part has a
                wrong type.
            FileError: the file of a preset cannot be read.
        """
        sampling = self._sampling()
        sampler = flight.sampler
        if sampling is not None:
            # The user's own sampler gets the MPPI and cost numbers of the default sampler.
            own = not is_registered(sampling)
            sampler = FlightSettings.sampler if own else sampler_name(sampling)
        firmware = flight.flight_controller != "ideal"
        return PlannerSource(self._planner(), self._preset(flight), sampler, sampling, firmware)

    def _planner(self) -> Planner | None:
        """Return the planner if it was given, else None. Raises SettingError."""
        planner = self.given.get("planner")
        if planner is None:
            return None
        for name in ("sampler", "preset"):
            if self.given.get(name) is not None:
                wanted = "expected none: the planner of a stored run, or planner=, has its own"
                raise SettingError(name, wanted)
        check_type("planner", planner, Planner)
        return planner

    def _preset(self, flight: FlightSettings) -> PresetSource:
        """Return the source of the preset's numbers. Raises SettingError, FileError."""
        preset = self.given.get("preset")
        if isinstance(preset, PresetSource):
            return preset
        if not (preset is None or isinstance(preset, str | Path)):
            wanted = "expected a name or a FILE.yaml"
            raise SettingError("preset", f"{wanted}, got {shown_value(preset)}")
        found = PresetSource.read(flight.preset)
        if "preset" in self.given:
            self.read["preset"] = found
        return found

    def _sampling(self) -> Any:
        """Return a sampler that was given as an object or as "package.module:Class".

        Returns:
            The sampler; None if the name of a registered sampler or no sampler was given.

        Raises:
            SettingError: there is no such sampler.
        """
        given = self.given.get("sampler")
        if given is None or (isinstance(given, str) and given in SAMPLERS):
            return None
        self.read["sampler"] = given if is_registered(given) else own_sampler(given)
        return self.read["sampler"]


def is_seen_late(flight: FlightSettings, randomization: RandomizationRanges) -> bool:
    """Return whether gates are displaced from the map and their true positions seen late."""
    off = Displacement.of(randomization, flight.randomize, flight.displace_gates)
    return flight.known_from is not None and off.gates > 0.0


def scale_of(
    course: Course,
    vehicle: Vehicle,
    given: Mapping[str, Any],
    base: Planner,
    seen_late: bool,
) -> Scale:
    """Return the scale of a flight, from which numbers of a preset follow.

    Args:
        course: the planner's map.
        vehicle: the vehicle.
        given: the settings, which may have a control period and a weight `time_to_go`.
        base: the planner of the preset, with the control period if none is given.
        seen_late: result of `is_seen_late`.

    Raises:
        SettingError: the control period or the weight is invalid.
    """
    kind = SETTINGS["dt"].kinds[MPPIConfig]
    asked = given.get("dt")
    period: Any = base.mppi.dt if asked is None else checked("dt", asked, kind)
    weight = given.get("time_to_go")
    may_value = weight is None or checked("time_to_go", weight, SETTINGS["time_to_go"].kind) != 0.0
    return Scale.of(course, vehicle, period, seen_late, may_value)


def _with_law(planner: Planner, law: object) -> Planner:
    """Return the planner, whose cut-off frequencies are removed unless the law is "exact".

    Args:
        planner: the planner of the preset.
        law: the given law, if any.
    """
    sampling = planner.sampling
    if not isinstance(sampling, Colored) or law in (None, "exact"):
        return planner
    return replace(planner, sampling=replace(sampling, cutoff=()))


def with_numbers(planner: Planner, given: Mapping[str, Any]) -> Planner:
    """Return the planner with the given numbers of its sampler, MPPI and cost."""
    planner = _with_law(planner, given.get("law"))
    groups: tuple[Group, ...] = ("sampling", "mppi", "cost")
    parts = {group: with_settings(group, getattr(planner, group), given) for group in groups}
    changed = replace(planner, **parts)
    if given.get("horizon") is not None or changed.mppi.dt == planner.mppi.dt:
        return changed
    steps = with_period(planner, changed.mppi.dt).mppi.horizon
    return replace(changed, mppi=replace(changed.mppi, horizon=steps))


def nominal_model(given: Mapping[str, Any], vehicle: Vehicle) -> ModelParams:
    """Return the planner's model: the vehicle's nominal model with the given numbers.

    With the firmware it is replaced by the model that is identified on the test bench.
    """
    model = given.get("model")
    if model is None:
        model = ModelParams.of(vehicle)
    check_type("model", model, ModelParams)
    return with_settings("model", model, given)


def with_settings(group: Group, values: Any, given: Mapping[str, Any]) -> Any:
    """Return a group's values with the given settings. Raises SettingError."""
    owner: type[object] = values.__class__
    changes: dict[str, object] = {}
    for name, value in given.items():
        setting = SETTINGS.get(name)
        if setting is None or setting.group != group:
            continue
        kind = setting.kinds.get(owner)
        if value is None and (kind is None or not is_optional(kind)):
            continue  # the default
        if kind is None:
            raise SettingError(name, _owners(setting))
        changes[setting.field] = checked(name, value, kind, may_be_off=True)
    return replace(values, **changes) if changes else values


def _owners(setting: Setting) -> str:
    """Return the samplers or costs that have a setting, as the text of an error."""
    names = [name for name, cls in SAMPLERS.items() if cls in setting.kinds]
    if names:
        return f"it is a setting of {' and '.join(names)} sampling only: leave it out"
    owners = " and ".join(owner.__name__ for owner in setting.kinds)
    return f"it is a setting of {owners} only: leave it out"


def view_weight_of(flight: FlightSettings, base: Planner, sensing: Sensing) -> float:
    """Return the weight of the cost term that makes the camera look along the flight.

    The term helps if a camera has to find displaced gates; otherwise a flight without yaw is
    faster.
    """
    if flight.view_weight is not None:
        return flight.view_weight
    return base.view_weight if sensing.corner_camera and flight.displace_gates else 0.0


def default_timeout(course: Course, laps: int) -> float:
    """Return the default time limit [s]: 10 s plus the time of the laps at 2 m/s.

    It is at most the largest valid `timeout`.
    """
    return min(10.0 + laps * course.lap_length / 2.0, 1e5)
