"""Functions as commands: cyclopts reads the words, the rules of files (quadsim.files) judge the
values.

A parameter's annotation holds its unit, range and help. Every error of a command line becomes a
UsageError of one
line: the flag, what was expected with its unit, what came.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from functools import wraps
from inspect import signature
from itertools import pairwise
from typing import Annotated, Any, Literal, TypedDict, get_type_hints

from cyclopts import App, CycloptsError, Group, Parameter, exceptions
from msgspec import inspect

from controllers.samplers import SAMPLERS
from quadsim.console import UsageError
from quadsim.files.yaml_errors import did_you_mean, expected
from quadsim.spec.preset_file import load_planner
from quadsim.spec.settings import FlightSettings, Setting, SettingError, bare, checked, settings_of
from quadsim.spec.systems import SYSTEMS, SystemEntry, system_of_course


@contextmanager
def settings_as_flags() -> Iterator[None]:
    """Errors in settings, and in how course, laps and vehicle fit together, become UsageErrors;
    others pass."""
    try:
        yield
    except SettingError as error:
        raise UsageError(f"{flag(error.name)}: {error.problem}") from None
    except ValueError as error:  # laps on an open course, a gate too small for the vehicle
        if type(error) is not ValueError:
            raise
        raise UsageError(str(error)) from None


def Help(text: str, **parameter: Any) -> Parameter:  # noqa: N802 (reads as an annotation)
    """What --help says of a flag."""
    return Parameter(help=text, **parameter)


def Switch(text: str) -> Parameter:  # noqa: N802
    """A flag without a value, off unless it is given."""
    return Help(text, negative="", show_default=False)


Json = Annotated[bool, Switch("one JSON value instead of tables")]
RunsDir = Annotated[str, Help("where runs are kept")]
Stored = Annotated[str, Help("a run: its folder, a part of its name, or last")]
# settings that were given on the command line: words by name, see settings.checked
Given = dict[str, Any] | None

TITLES = {
    "flight": "Flight",
    "sampling": "Sampling",
    "mppi": "Planner",
    "cost": "Cost",
    "model": "Model",
}


def run_command(command: Callable[..., int], prog: str, argv: Sequence[str]) -> int:
    """Call the command with what argv says. Raises UsageError, and what the command raises;
    `--help` returns 0."""
    settings = flight_settings(argv) if _hints(command).get("settings") == Given else {}
    usage = _usage(prog, command)
    app = App(
        name=prog,
        usage=usage,
        version_flags=(),
        help_format="plaintext",
        help_flags=("--help", "-h"),
    )
    app["--help"].group = app.group_parameters
    app.default(with_flags(command, settings))
    try:
        call, given, _ = app.parse_args(argv, print_error=False, exit_on_error=False)
    except CycloptsError as error:
        raise UsageError(_line(error, app, settings)) from None
    if getattr(call, "__wrapped__", None) is not command:
        call(*given.args, **given.kwargs)  # --help
        return 0
    for name, value in given.arguments.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            check(name, value, _hints(command)[name])
    return call(*given.args, **given.kwargs)


def _usage(prog: str, command: Callable[..., int]) -> str:
    """What may be left out stands in brackets."""
    words = [prog]
    for p in signature(command).parameters.values():
        if p.kind is p.VAR_POSITIONAL:
            words.append(f"[{p.name.upper()}...]")
        elif p.kind is p.POSITIONAL_ONLY:
            words.append(p.name.upper() if p.default is p.empty else f"[{p.name.upper()}]")
    return f"Usage: {' '.join(words)} [FLAGS]"


def with_flags(
    command: Callable[..., int], settings: dict[str, Setting] | None = None
) -> Callable[..., int]:
    """The same command, with its settings, or those of a default flight, as flags."""

    @wraps(command)
    def flagged(*args: Any, **kwargs: Any) -> int:
        return command(*args, **kwargs)

    hints = _hints(command)
    if hints.get("settings") == Given:
        of_flight = _typed_dict(flight_settings(()) if settings is None else settings)
        hints["settings"] = Annotated[of_flight, Parameter(name="*")]
    given = [p.replace(annotation=hints[p.name]) for p in signature(command).parameters.values()]
    flagged.__annotations__ = hints
    flagged.__signature__ = signature(command).replace(parameters=given)  # pyright: ignore
    return flagged


def check(name: str, value: Any, hint: Any) -> None:
    """Hold a flag's value against the range in its annotation. Raises UsageError."""
    try:
        checked(inspect.type_info(hint), name, value)
    except SettingError as error:
        raise UsageError(f"{flag(name)}: {error.problem}") from None


def flag(name: str) -> str:
    """The setting "rest_fraction" is set by `--rest-fraction`, "model.drag" by `--model.drag`."""
    return "--" + name.replace("_", "-")


def flight_settings(argv: Sequence[str]) -> dict[str, Setting]:
    """Every setting that a flight with these words has, by name: of its system, sampler and preset.

    Raises UsageError for a system, FileError for a preset that does not exist.
    """
    entry = _entry_of(argv)
    sampler = last_said(argv, "--sampler", FlightSettings.sampler)
    # "module:Class" has no flags; of other names `resolve` says what is wrong
    own = sampler not in SAMPLERS
    preset = last_said(argv, "--preset", entry.default_preset)
    base = load_planner(preset, "colored" if own else sampler, entry.presets, entry.control_units)
    return {
        name: s
        for name, s in settings_of(entry, base).items()
        if not (own and s.group == "sampling")
    }


def _entry_of(argv: Sequence[str]) -> SystemEntry:
    """The system that these words ask for: by --system, else by a course among them."""
    system = last_said(argv, "--system", "")
    if system and system not in SYSTEMS:
        raise UsageError(f"--system: no system {system!r}: {did_you_mean(system, SYSTEMS)}")
    courses = (system_of_course(word) for word in argv if not word.startswith("-"))
    return SYSTEMS[system or next((name for name in courses if name != "quadrotor"), "quadrotor")]


def last_said(argv: Sequence[str], name: str, default: str) -> str:
    """What argv says after this flag, the last time it does."""
    words = [
        w for arg in argv for w in (arg.split("=", 1) if arg.startswith(f"{name}=") else [arg])
    ]
    values = [b for a, b in pairwise(words) if a == name]
    return values[-1] if values else default


def _hints(command: Callable[..., int]) -> dict[str, Any]:
    return get_type_hints(command, include_extras=True)


def _typed_dict(settings: dict[str, Setting]) -> Any:
    """A type for cyclopts with one key for each setting, none required."""
    groups = {group: Group(title, sort_key=i) for i, (group, title) in enumerate(TITLES.items())}
    kinds = {s.name: _annotated(s, groups[s.group]) for s in settings.values()}
    return TypedDict("Settings", kinds, total=False)  # pyright: ignore


def _annotated(s: Setting, group: Group) -> Any:
    """What follows the flag: nothing, one word or several, which `resolve` judges; and its help."""
    text = (
        s.help
        if s.default is None or s.default is False or s.default == ()
        else f"{s.help} [default: {_text(s.default)}]"
    )
    hint, metavar = str, None
    match bare(s.kind):
        case inspect.BoolType():
            hint = bool
        case inspect.LiteralType(values):
            hint = Literal[tuple(values)]
        case inspect.TupleType(items):
            hint, metavar = tuple[(str,) * len(items)], " ".join("X" * len(items))  # pyright: ignore
        case inspect.VarTupleType():
            hint, metavar = list[str], "MODULE:FUNCTION=WEIGHT"
        case inspect.FloatType():
            metavar = "X"
        case inspect.IntType():
            metavar = "N"
    if s.name == "sampler":
        hint, metavar = Literal[tuple(SAMPLERS)] | str, "NAME"
    parameter = Parameter(
        name=flag(s.name), group=group, help=text, metavar=metavar, negative_iterable=""
    )
    return Annotated[hint, parameter]


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        return " ".join(map(_text, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _line(error: CycloptsError, app: App, settings: dict[str, Setting]) -> str:
    """cyclopts' error in our words."""
    name = error.argument.name if error.argument else ""
    match error:
        case exceptions.UnknownOptionError():
            word = (error.token.keyword or error.token.value).partition("=")[0]
            known = [
                n
                for argument in app.assemble_argument_collection()
                for n in argument.names
                if n[:2] == "--"
            ]
            near = [f": did you mean {n!r}?" for n in get_close_matches(word, known, n=1)]
            return f"no flag {word}{''.join(near)} (see {app.name[0]} --help)"
        case exceptions.UnusedCliTokensError():
            return f"unexpected {' '.join(map(repr, error.unused_tokens or ()))} (see {app.name[0]} --help)"
        case exceptions.RepeatArgumentError():
            return f"{error.token.keyword}: expected once, got it twice"
        case exceptions.CoercionError() | exceptions.MissingArgumentError() if error.argument:
            token = error.token if isinstance(error, exceptions.CoercionError) else None
            setting = settings.get(name.removeprefix("--").replace("-", "_"))
            hint: Any = setting.kind if setting else inspect.type_info(error.argument.hint)
            return f"{name}: expected {expected(hint)}, got {repr(token.value) if token else 'too few values'}"
    return str(error).splitlines()[-1]
