"""The table of all settings of a flight, which is made from annotated dataclasses.

A setting is a field of one of the dataclasses below. Its annotation holds its help, its unit and
its range. Everything else follows from it: the flag of `race fly`, the keyword of `quadsim.fly`,
and the error for an invalid value. A number of the planner is a key of a preset file and a
slider of the page as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal, NamedTuple

from msgspec import Meta, inspect

from quadsim.controllers.config import MPPIConfig
from quadsim.controllers.costs.race import RaceWeights, Weight
from quadsim.controllers.costs.reference import ReferenceWeights
from quadsim.controllers.presets import Planner
from quadsim.controllers.samplers import SAMPLERS
from quadsim.dynamics.named_tuples import units_of
from quadsim.dynamics.quadrotor import Control, ModelParams
from quadsim.files.strict_yaml import setting, unit
from quadsim.files.values import Kind as Kind
from quadsim.files.values import SettingError as SettingError
from quadsim.files.values import bare as bare
from quadsim.files.values import is_optional as is_optional
from quadsim.files.yaml_errors import unless_null
from quadsim.firmware import FlightControllerName
from quadsim.physics.plant import PlantName
from quadsim.physics.randomization_file import OUTDOOR_NAME
from quadsim.sensing import PERFECT

Clock = Literal["simulated", "wall"]
LapCount = Annotated[int, Meta(ge=1, le=1000)]
ThreadCount = Annotated[int, Meta(ge=1)]
FileName = Annotated[str, Meta(min_length=1)]
ThrustToWeight = Annotated[float, Meta(gt=1, le=20)]
TimeLimit = Annotated[float, unit("s", gt=0, le=1e5)]
FrameRate = Annotated[float, unit("Hz", ge=1, le=1e4)]
BurstLength = Annotated[float, Meta(ge=1, le=1e4)]
Distance = Annotated[float, unit("m", ge=0, le=1000)]
Milliseconds = Annotated[float, unit("ms", gt=0, le=1e4)]
CONTROL_UNITS = ", ".join(units_of(Control).values())


@dataclass(frozen=True, kw_only=True)
class PartSettings:
    """The settings that choose the parts of a flight; None stands for the default in the help.

    A Spec has the chosen parts instead: a vehicle rather than its name, the laps of the course.
    """

    sampler: Annotated[
        str, setting("sampling distribution, or package.module:Class of your own")
    ] = "colored"
    pilot: Annotated[
        str | None, setting("learned pilot in the planner's place: FILE.npz or split_s_swift")
    ] = None
    controller: Annotated[
        str | None,
        setting("controller of your own in the planner's place, package.module:Class"),
    ] = None
    preset: Annotated[str, setting("source of the planner's numbers: a name or a FILE.yaml")] = (
        "race"
    )
    competition: Annotated[
        str | None,
        setting(
            "a competition, whose course and settings stand in for those that are not given: a name"
            " or a FILE.yaml (default: none)"
        ),
    ] = None
    vehicle: Annotated[
        str | None, setting("vehicle: a name or a FILE.yaml (default: the preset's)")
    ] = None
    thrust_to_weight: Annotated[
        ThrustToWeight | None, setting("thrust-to-weight ratio in place of the vehicle's")
    ] = None
    laps: Annotated[
        LapCount | None, setting("laps from a standing start (default: the course's)")
    ] = None
    timeout: Annotated[
        TimeLimit | None, setting("time limit (default: by the course's length)")
    ] = None
    sensing: Annotated[
        str, setting("sensors: a name or a FILE.yaml; perfect gives the planner the true state")
    ] = PERFECT
    randomization: Annotated[
        str, setting("what randomize draws, and how widely: a name or a FILE.yaml")
    ] = OUTDOOR_NAME
    view_weight: Annotated[
        Weight | None,
        setting(
            "weight of the cost term that points the camera along the flight (default: the"
            " preset's with displaced gates, else 0)"
        ),
    ] = None
    plant: Annotated[
        PlantName | None, setting("simulator (default: bullet if PyBullet is installed)")
    ] = None
    betaflight: Annotated[
        str | None,
        setting("Betaflight's configuration, FILE.txt of its CLI (default: the vehicle's)"),
    ] = None
    term: Annotated[
        tuple[str, ...],
        setting("cost term of your own, package.module:function=WEIGHT; may be repeated"),
    ] = ()


@dataclass(frozen=True, kw_only=True)
class FlightNumbers:
    """The settings that a Spec stores unchanged, and that a run records.

    A new setting needs a field here and code that uses it, then `make fix`, which writes the
    keywords and the tables of the documentation, and a value in
    `test_every_number_of_a_flight_is_recorded_and_read`.
    """

    seed: Annotated[int, setting("random seed", ge=0, le=10**9)] = 0
    randomize: Annotated[
        float, setting("scale of domain randomization: start, vehicle and gusts", ge=0, le=3)
    ] = 0.0
    displace_gates: Annotated[
        float, setting("gates stand up to this far off the map along x and y", "m", ge=0, le=1)
    ] = 0.0
    map_scale: Annotated[
        float,
        setting(
            "size of the map that the planner flies by, as a share of the course as it stands: a"
            " map of .93 has gates and obstacles 7 % too near to the start",
            ge=0.5,
            le=2,
        ),
    ] = 1.0
    known_from: Annotated[
        Distance | None,
        setting(
            "horizontal distance within which gates and obstacles that stand off the map are known"
            " where they stand (default: the planner flies by the map)"
        ),
    ] = None
    fault: Annotated[
        tuple[str, ...],
        setting(
            "failure in flight, such as rotor2=.5@3.2, gyro=frozen@2-2.5, camera=lost~1 or"
            " commands=lost@2~.1; the seed draws what is left out; may be repeated"
        ),
    ] = ()
    excite: Annotated[
        bool,
        setting(
            "manoeuvres within a box in the planner's place, to fit a vehicle from; on the sensors"
            " of mocap, which are recorded, unless others are given"
        ),
    ] = False
    penalties: Annotated[bool, setting("a hit adds 3 s and does not end the flight")] = False
    plant_dt: Annotated[
        float, setting("physics step, .001 behind betaflight", "s", ge=1e-4, le=0.02)
    ] = 1 / 400
    flight_controller: Annotated[
        FlightControllerName,
        setting("ideal: a first-order rate loop; betaflight: the firmware, in lock step"),
    ] = "ideal"
    link_hz: Annotated[
        FrameRate | None,
        setting("frames a second in which commands arrive (default: one in each physics step)"),
    ] = None
    link_latency: Annotated[
        float, setting("latency of the link, beside the vehicle's", "s", ge=0, le=1)
    ] = 0.0
    link_loss: Annotated[
        float, setting("share of the link's frames that are lost", ge=0, le=0.9)
    ] = 0.0
    link_burst: Annotated[
        BurstLength | None,
        setting("mean number of frames lost in a row (default: they are lost independently)"),
    ] = None
    predict: Annotated[
        bool,
        setting(
            "gives the controller the state in which its command will act, predicted by the"
            " planner's model; off: the state as measured"
        ),
    ] = True
    clock: Annotated[
        Clock, setting("simulated: planning takes no time; wall: the flight continues meanwhile")
    ] = "simulated"
    deadline_ms: Annotated[
        Milliseconds | None,
        setting("longest time of a plan, kept by fewer samples (default: none)"),
    ] = None


@dataclass(frozen=True, kw_only=True)
class HostSettings:
    """The settings that a Spec stores unchanged, and that do not change a flight."""

    threads: Annotated[
        ThreadCount | None, setting("CPU threads, which do not change results (default: all)")
    ] = None
    blackbox: Annotated[
        FileName | None,
        setting("keeps the firmware's own log of the flight, FILE.bbl (default: none)"),
    ] = None
    record_sensing: Annotated[
        bool, setting("keeps every measurement of the sensors, and what the estimator made of it")
    ] = False
    runs_dir: Annotated[
        str, setting("folder of runs and of the solutions of race limit", min_length=1)
    ] = "runs"


@dataclass(frozen=True, kw_only=True)
class FlightSettings(HostSettings, FlightNumbers, PartSettings):
    """The settings of a flight, without those of its planner."""


# The settings that a Spec holds as they are given
HELD = tuple(f.name for f in (*fields(FlightNumbers), *fields(HostSettings)))


Group = Literal["flight", "sampling", "mppi", "cost", "model"]
OWNERS: dict[Group, tuple[type, ...]] = {
    "flight": (FlightSettings,),
    "sampling": tuple(SAMPLERS.values()),
    "mppi": (MPPIConfig,),
    "cost": (RaceWeights, ReferenceWeights),
    "model": (ModelParams,),
}
# Begins the names of the model's settings, as a vehicle has numbers of the same names.
PREFIX = "model_"


@dataclass(frozen=True)
class Setting:
    """One setting, which several classes of a group may share: every sampler has a sigma."""

    name: str  # keyword, "model_drag"
    group: Group
    field: str  # in its dataclass, "drag"
    kinds: Mapping[type, Kind]  # dataclass that has it -> its kind there
    help: str

    @property
    def flag(self) -> str:
        """The flag of the command line, such as "--model-drag"."""
        return "--" + self.name.replace("_", "-")

    @property
    def unit(self) -> str:
        """The unit of the setting's numbers, "" if they have none."""
        return unit_of(self.kind)

    @property
    def kind(self) -> Kind:
        """The kind of the setting in the first of its dataclasses."""
        return next(iter(self.kinds.values()))


def description(kind: Kind) -> str:
    """Return the help in an annotation, "" if there is none."""
    match kind:
        case inspect.Metadata():
            schema = kind.extra_json_schema or {}
            return schema.get("description") or description(kind.type)
        case inspect.UnionType():
            return description(unless_null(kind))
    return ""


def unit_of(kind: Kind) -> str:
    """Return the unit in an annotation, "" if there is none."""
    match kind:
        case inspect.Metadata():
            return (kind.extra or {}).get("unit") or unit_of(kind.type)
        case inspect.UnionType():
            return unit_of(unless_null(kind))
        case inspect.TupleType():
            return unit_of(kind.item_types[0])
    return ""


def _kind_of_each_control(name: str, kind: Kind) -> Kind:
    """Return the kind of a tuple with one number for each control; other kinds are unchanged."""
    if isinstance(kind, inspect.Metadata):
        inner = _kind_of_each_control(name, kind.type)
        return inspect.Metadata(inner, kind.extra_json_schema, kind.extra)
    if isinstance(kind, inspect.UnionType):
        return inspect.UnionType(tuple(_kind_of_each_control(name, one) for one in kind.types))
    if not isinstance(kind, inspect.VarTupleType):
        return kind
    numbers = inspect.TupleType((kind.item_type,) * len(Control._fields))
    return inspect.Metadata(numbers, extra={"unit": CONTROL_UNITS}) if name == "sigma" else numbers


def _kinds(group: Group, owner: type) -> Iterator[tuple[str, Kind]]:
    """Yield the name and the kind of each setting of a dataclass."""
    known = {f.name for f in fields(owner)} - {"name"}
    for field in inspect.type_info(owner).fields:  # pyright: ignore[reportAttributeAccessIssue]
        if field.name in known:
            per_control = group == "sampling"
            kind = _kind_of_each_control(field.name, field.type) if per_control else field.type
            yield field.name, kind


def _table() -> dict[str, Setting]:
    """Return every setting by name, in the order of the groups."""
    table: dict[str, Setting] = {}
    for group, owners in OWNERS.items():
        for owner in owners:
            for field, kind in _kinds(group, owner):
                name = PREFIX + field if group == "model" else field
                kinds = {**table[name].kinds, owner: kind} if name in table else {owner: kind}
                text = table[name].help if name in table else description(kind)
                table[name] = Setting(name, group, field, kinds, text)
    return table


SETTINGS = _table()


class SettingValue(NamedTuple):
    """The value and the kind of a setting of one planner."""

    setting: Setting
    kind: Kind  # in the dataclass of this planner's sampler or cost
    value: Any


def kinds_of(planner: Planner) -> dict[str, Kind]:
    """Return the kinds of the settings that a planner and its model have, in the table's order."""
    classes: list[type] = [
        type(planner.sampling),
        type(planner.mppi),
        type(planner.cost),
        ModelParams,
    ]
    return {
        name: row.kinds[cls]
        for name, row in SETTINGS.items()
        for cls in classes
        if cls in row.kinds
    }


def values_of(planner: Planner, model: ModelParams) -> dict[str, SettingValue]:
    """Return the settings of a planner and its model by name, in the order of the table."""
    parts = {
        "sampling": planner.sampling,
        "mppi": planner.mppi,
        "cost": planner.cost,
        "model": model,
    }
    found = {}
    for name, kind in kinds_of(planner).items():
        row = SETTINGS[name]
        found[name] = SettingValue(row, kind, getattr(parts[row.group], row.field))
    return found
