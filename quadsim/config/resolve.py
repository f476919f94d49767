"""The parts of a flight that its settings stand for: files are read, and defaults are found."""

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
    """Check that each name is a setting's. Raises SettingError."""
    for name in given:
        if name not in KEYWORDS:
            raise SettingError(name, f"no such setting, {did_you_mean(name, KEYWORDS)}")


def with_excitation(given: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the settings with the defaults of a flight of manoeuvres, if it is to be one.

    Raises:
        SettingError: something else is to fly, too.
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
    """The source of a planner before single numbers change: a preset or numbers of its own."""

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
            FileError: there is no such preset, or its file does not hold a preset.
        """
        if self.planner is not None:
            return self.planner
        found = self.preset.planner(self.sampler, self.firmware, scale)
        return found if self.sampling is None else replace(found, sampling=self.sampling)


class Loader:
    """The settings of a flight, and the objects that stand in for names among them.

    Each file is read once: `Spec.but` changes the objects that were read.

    Attributes:
        given: the settings.
        read: the objects by the names of their settings.
    """

    def __init__(self, given: Mapping[str, Any]):
        """Begin with settings in which nothing has been read.

        Args:
            given: the settings.
        """
        self.given = given
        self.read: dict[str, Any] = {}

    def part(self, name: str, kind: type[T], load: Callable[[str], T], default: str) -> T:
        """Return a part that was given by name, as a FILE.yaml or as an object, or the default.

        Args:
            name: name of the setting.
            kind: type of the object.
            load: reads the part that a name or path stands for; raises FileError.
            default: name to load if no part is given.

        Raises:
            SettingError: the part is neither a name nor an object of its type.
        """
        found = self.given_part(name, kind, load)
        return load(default) if found is None else found

    def given_part(self, name: str, kind: type[T], load: Callable[[str], T]) -> T | None:
        """Return a part that was given, None if none was; see `part`. Raises SettingError."""
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
        """Return the firmware's configuration: the given or the vehicle's, which may be missing.

        Raises:
            SettingError: it is no file.
            FileError: its file cannot be read.
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
        """Return the user's own controller, None if none was given. Raises SettingError."""
        given = self.given.get("controller")
        if given is None:
            return None
        self.read["controller"] = own_controller(given)
        return self.read["controller"]

    def planner_source(self, flight: FlightSettings) -> PlannerSource:
        """Return where the planner comes from.

        Raises:
            SettingError: a planner is given beside a sampler or a preset, or a part is
                not of its type.
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
        """Return the planner that was given, None if none was. Raises SettingError."""
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
        """Return the preset. Raises SettingError, FileError."""
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
            The sampler, or None for the name of a registered one and if none was given.

        Raises:
            SettingError: there is no such sampler.
        """
        given = self.given.get("sampler")
        if given is None or (isinstance(given, str) and given in SAMPLERS):
            return None
        self.read["sampler"] = given if is_registered(given) else own_sampler(given)
        return self.read["sampler"]


def is_seen_late(flight: FlightSettings, randomization: RandomizationRanges) -> bool:
    """Return whether gates stand off the map and are known only from nearby."""
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
        given: the settings, which may have a control period.
        base: the planner of the preset, with the control period if none is given.
        seen_late: whether gates stand off the map and are known only from nearby.

    Raises:
        SettingError: the control period is invalid.
    """
    kind = SETTINGS["dt"].kinds[MPPIConfig]
    asked = given.get("dt")
    period: Any = base.mppi.dt if asked is None else checked("dt", asked, kind)
    return Scale.of(course, vehicle, period, seen_late)


def _with_law(planner: Planner, law: object) -> Planner:
    """Return the planner, without its cut-off frequencies if the given law is not "exact".

    Args:
        planner: the planner of the preset.
        law: the law that was given, if any.
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
    """Return the planner's model: the vehicle's nominal one with the given numbers.

    Behind the firmware it is replaced by the model that a flight on the test bench shows.
    """
    model = given.get("model")
    if model is None:
        model = ModelParams.of(vehicle)
    check_type("model", model, ModelParams)
    return with_settings("model", model, given)


def with_settings(group: Group, values: Any, given: Mapping[str, Any]) -> Any:
    """Return a group's dataclass with the settings that were given. Raises SettingError."""
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
        changes[setting.field] = checked(name, value, kind)
    return replace(values, **changes) if changes else values


def _owners(setting: Setting) -> str:
    """Return an error's text with the samplers or costs that have this setting."""
    names = [name for name, cls in SAMPLERS.items() if cls in setting.kinds]
    if names:
        return f"expected none, it is a setting of {' and '.join(names)} sampling only"
    owners = " and ".join(owner.__name__ for owner in setting.kinds)
    return f"expected none, it is a setting of {owners} only"


def view_weight_of(flight: FlightSettings, base: Planner, sensing: Sensing) -> float:
    """Return the weight of the cost term that makes the camera look along the flight.

    It helps if a camera has to find displaced gates; otherwise a flight without yaw is faster.
    """
    if flight.view_weight is not None:
        return flight.view_weight
    return base.view_weight if sensing.corner_camera and flight.displace_gates else 0.0


def default_timeout(course: Course, laps: int) -> float:
    """Return the time limit [s]: 10 s, and the laps at 2 m/s along the lines between gates.

    It is at most the largest `timeout` that may be given.
    """
    return min(10.0 + laps * course.lap_length / 2.0, 1e5)
