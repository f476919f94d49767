"""Annotations of the commands' flags, and the flags of a flight: one per setting.

The annotation of a parameter holds its help, its unit and its range. cyclopts reads the command
line and completes it; quadsim.files.values checks the values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypedDict

from cyclopts import Group, Parameter
from msgspec import Meta, inspect

from quadsim.config.competition import competition_names
from quadsim.config.identity import error_text
from quadsim.config.settings import (
    SETTINGS,
    FlightSettings,
    Setting,
    SettingError,
    bare,
    description,
    values_of,
)
from quadsim.console import UsageError
from quadsim.controllers.presets import PRESETS
from quadsim.controllers.samplers import SAMPLERS
from quadsim.course import course_names
from quadsim.dynamics.quadrotor import ModelParams
from quadsim.heat.settings import HeatSettings
from quadsim.physics.randomization_file import randomization_names
from quadsim.sensing import sensing_names
from quadsim.vehicle import load_vehicle, vehicle_names

TITLES = {
    "flight": "Flight",
    "sampling": "Sampling",
    "mppi": "Planner",
    "cost": "Cost",
    "model": "Planner's model of the vehicle",
}
# Formats of the values of flags that name parts of the user's own, or may be repeated.
METAVARS = {
    "controller": "MODULE:CLASS",
    "term": "MODULE:FUNCTION=WEIGHT",
    "fault": "PART=WHAT@TIME",
}
DEFAULT_PLANNER = PRESETS[FlightSettings.preset][FlightSettings.sampler]


@contextmanager
def settings_as_flags() -> Iterator[None]:
    """Convert errors in settings, and misfits between the parts of a flight, to UsageErrors."""
    try:
        yield
    except SettingError as error:
        raise UsageError(f"{flag(error.name)}: {error.problem}") from None
    except ValueError as error:  # laps on an open course, a gate too small for the vehicle
        if type(error) is not ValueError:
            raise
        raise UsageError(error_text(error)) from None
    except FloatingPointError as error:  # a term of the user's own makes every cost NaN
        raise UsageError(error_text(error)) from None


def flag(name: str) -> str:
    """Return the flag of a setting or a parameter, "--rest-fraction" of "rest_fraction"."""
    return "--" + name.replace("_", "-")


def Help(text: str, **parameter: Any) -> Parameter:  # noqa: N802 (reads as an annotation)
    """Return the parameter of a flag with this text in --help."""
    return Parameter(help=text, **parameter)


def Switch(text: str) -> Parameter:  # noqa: N802
    """Return the parameter of a flag without a value, which is off by default."""
    return Help(text, negative="", show_default=False)


def names(known: Callable[[], Iterable[str]]) -> Callable[[object], list[str]]:
    """Return a completer that proposes these names."""
    return lambda context: list(known())


def stored_runs() -> list[str]:
    """Return the names of the stored runs in the folder `runs`, and "last"."""
    from quadsim.record.archive import list_runs

    return ["last", *(run.name for run in list_runs(FlightSettings.runs_dir))]


def stored_runs_and_races() -> list[str]:
    """Return the names of the stored runs and races in the folder `runs`, and "last"."""
    from quadsim.record.archive import list_heats

    return [*stored_runs(), *(heat.name for heat in list_heats(FlightSettings.runs_dir))]


COMPLETERS = {
    "preset": names(lambda: PRESETS),
    "vehicle": names(vehicle_names),
    "sensing": names(sensing_names),
    "competition": names(competition_names),
    "randomization": names(randomization_names),
}


def course_help(text: str = "a name (see `race courses`) or a FILE.yaml") -> Parameter:
    """Return the help of a course, whose names are proposed."""
    return Help(text, completer=names(course_names))


def vehicle_help(text: str = "a name (see `race vehicles`) or a FILE.yaml") -> Parameter:
    """Return the help of a vehicle, whose names are proposed."""
    return Help(text, completer=names(vehicle_names))


Json = Annotated[bool, Switch("print one JSON value in place of tables")]
RunsDir = Annotated[str, Meta(min_length=1), Help("folder of the runs")]
Stored = Annotated[
    str,
    Help(
        "a run: its folder, a part of its name, or last",
        completer=names(stored_runs_and_races),
    ),
]
CourseName = Annotated[
    str | None,
    course_help("a name (see `race courses`) or a FILE.yaml; default: split_s_swift"),
]


def _flight_flags() -> Any:
    """Return a type for cyclopts with one key for each setting, none required."""
    groups = {group: Group(title, sort_key=k) for k, (group, title) in enumerate(TITLES.items())}
    defaults = _defaults()
    flags = {
        name: _flag(setting, groups[setting.group], defaults.get(name))
        for name, setting in SETTINGS.items()
    }
    return TypedDict("FlightFlags", flags, total=False)  # pyright: ignore[reportArgumentType]


def _defaults() -> dict[str, object]:
    """Return the value of each setting of the default flight that has one."""
    model = ModelParams.of(load_vehicle(DEFAULT_PLANNER.vehicle))
    defaults = {name: found.value for name, found in values_of(DEFAULT_PLANNER, model).items()}
    flight = FlightSettings()
    return defaults | {f.name: getattr(flight, f.name) for f in fields(flight)}


def _flag(setting: Setting, group: Group, default: object) -> Any:
    """Return the annotation of one flag.

    The flag takes one or several texts, which `Spec.of` checks.
    """
    hint: Any = str
    metavar = None
    match bare(setting.kind):
        case inspect.BoolType():
            hint = bool
        case inspect.LiteralType(values):
            hint = Literal[tuple(values)]
        case inspect.TupleType(items):
            hint = tuple[(str,) * len(items)]  # pyright: ignore[reportInvalidTypeForm]
            metavar = " ".join("X" * len(items))
        case inspect.VarTupleType():
            hint = list[str]
            metavar = METAVARS[setting.name]
        case inspect.FloatType():
            metavar = "X"
        case inspect.IntType():
            metavar = "N"
    if setting.name == "controller":
        metavar = METAVARS[setting.name]
    if setting.name == "sampler":
        hint = Literal[tuple(SAMPLERS)] | str
        metavar = "NAME"
    parameter = Parameter(
        name=setting.flag,
        group=group,
        help=_help(setting, default),
        metavar=metavar,
        negative_iterable="",
        completer=COMPLETERS.get(setting.name),
    )
    return Annotated[hint, parameter]


def _help(setting: Setting, default: object) -> str:
    """Return the help of a flag, with the units and the default of the default flight."""
    text = setting.help
    if setting.unit and setting.name != "sigma":
        text += f" [{setting.unit}]"
    if default is None or default is False or default == ():
        return text
    return f"{text} [default: {_shown(default)}]"


def _shown(value: object) -> str:
    if isinstance(value, tuple):
        return " ".join(map(_shown, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _heat_flags() -> Any:
    """Return a type for cyclopts with one key for each setting of a race of several vehicles."""
    group = Group("Race of several vehicles", sort_key=-1)
    defaults = HeatSettings()
    kinds = inspect.type_info(HeatSettings).fields  # pyright: ignore[reportAttributeAccessIssue]
    flags = {}
    for field in kinds:
        setting = Setting(
            field.name, "flight", field.name, {HeatSettings: field.type}, description(field.type)
        )
        flags[field.name] = _flag(setting, group, getattr(defaults, field.name))
    return TypedDict("RaceFlags", flags, total=False)  # pyright: ignore[reportArgumentType]


# The given settings by name; their values are texts, see quadsim.files.values.
if TYPE_CHECKING:
    Given = dict[str, Any] | None
    GivenHeat = dict[str, Any] | None
else:
    Given = Annotated[_flight_flags() | None, Parameter(name="*")]
    GivenHeat = Annotated[_heat_flags() | None, Parameter(name="*")]
