"""Functions as commands: cyclopts reads the words, the rules of files (quadsim.files) judge the values.

A parameter's annotation holds its unit, range and help. Every error of a command line becomes a UsageError of one
line: the flag, what was expected with its unit, what came.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from inspect import Parameter as Argument
from inspect import signature
from itertools import pairwise
from typing import Annotated, Any, Literal, TypedDict, get_type_hints

from cyclopts import App, Group, Parameter
from cyclopts.exceptions import (
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    RepeatArgumentError,
    UnknownOptionError,
    UnusedCliTokensError,
)
from msgspec import inspect

from controllers.samplers import SAMPLERS
from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_values import DECIMAL, WHOLE
from quadsim.files.yaml_words import did_you_mean, expected
from quadsim.race.preset_file import load_planner
from quadsim.race.settings import FlightSettings, Setting, SettingError, bare, checked_kind, settings_of
from quadsim.race.systems import SYSTEMS, SystemEntry, system_of_course


class UsageError(ValueError):
    """A command line that cannot be used. One line: the flag, what was expected with its unit, what came."""


def Help(text: str, **parameter: Any) -> Parameter:  # noqa: N802 (reads as an annotation)
    """What --help says of a flag."""
    return Parameter(help=text, **parameter)


Json = Annotated[bool, Help("one JSON value instead of tables", negative="")]
RunsDir = Annotated[str, Help("where runs are kept")]
Stored = Annotated[str, Help("a run: its folder, a part of its name, or last")]
Given = dict[str, Any] | None  # settings that were given on the command line, by name


class N(str):
    """A whole number, as a word."""


class X(str):
    """A number, as a word."""


TITLES = {"flight": "Flight", "sampling": "Sampling", "mppi": "Planner", "cost": "Cost", "model": "Model"}


def run_command(command: Callable[..., int], prog: str, argv: Sequence[str]) -> int:
    """Call the command with what argv says. Raises UsageError, and what the command raises; `--help` returns 0."""
    hints = get_type_hints(command, include_extras=True)
    settings = flight_settings(argv) if hints.get("settings") == Given else {}
    app = command_app(command, prog, settings)
    try:
        found = app.parse_args(argv, print_error=False, exit_on_error=False)
    except CycloptsError as error:
        raise UsageError(f"{_line(error, app, settings)} (see {prog} --help)") from None
    call, bound = found[0], found[1]
    if getattr(call, "__wrapped__", call) is not command:
        call(*bound.args, **bound.kwargs)  # --help
        return 0
    for name, value in bound.arguments.items():
        if name == "settings":
            bound.arguments[name] = {k: from_words(settings[k].kind, v) for k, v in (value or {}).items()}
        elif isinstance(value, int | float) and not isinstance(value, bool):
            check(name, value, hints[name])
    return command(*bound.args, **bound.kwargs)


def command_app(command: Callable[..., int], prog: str, settings: dict[str, Setting]) -> App:
    """cyclopts' application of one command."""
    app = App(name=prog, version_flags=(), help_format="plaintext", help_flags=("--help", "-h"))
    app.default(with_flags(command, settings))
    return app


def with_flags(command: Callable[..., int], settings: dict[str, Setting] | None = None) -> Callable[..., int]:
    """The same command, with its settings, or those of a default flight, as flags."""
    if settings is None:
        settings = flight_settings(())
    if get_type_hints(command).get("settings") != Given:
        return command

    @wraps(command)
    def flagged(*args: Any, **kwargs: Any) -> int:
        return command(*args, **kwargs)

    hints = get_type_hints(command, include_extras=True)
    flagged.__annotations__ = hints | {"settings": Annotated[_typed_dict(settings), Parameter(name="*")]}
    given = [p.replace(annotation=flagged.__annotations__[p.name]) for p in signature(command).parameters.values()]
    flagged.__signature__ = signature(command).replace(parameters=given)  # pyright: ignore
    return flagged


def check(name: str, value: Any, hint: Any) -> None:
    """Hold a flag's value against the range in its annotation. Raises UsageError."""
    try:
        checked_kind(inspect.type_info(hint), name, value)
    except SettingError as error:
        raise UsageError(f"{flag(name)}: {error.problem}") from None


def flag(name: str) -> str:
    """The setting "rest_fraction" is set by `--rest-fraction`, "model.drag" by `--model.drag`."""
    return "--" + name.replace("_", "-")


def from_words(kind: Any, words: Any) -> Any:
    """The words of a flag as its value; what is no number stays a text, for `resolve` to refuse."""
    if isinstance(words, tuple | list):
        return [from_words(None, word) for word in words]
    if not isinstance(words, str) or isinstance(bare(kind), inspect.StrType | inspect.LiteralType):
        return words
    if WHOLE.fullmatch(words):
        return int(words)
    return float(words) if DECIMAL.fullmatch(words) else words


def flight_settings(argv: Sequence[str]) -> dict[str, Setting]:
    """Every setting that a flight with these words has, by name: of its system, sampler and preset.

    Raises UsageError for a system, FileError for a preset that does not exist.
    """
    entry = entry_of(argv)
    sampler = said(argv, "--sampler", FlightSettings.sampler)
    own = ":" in sampler or sampler not in SAMPLERS  # `resolve` says what is wrong with the name
    base = load_planner(said(argv, "--preset", entry.default_preset), "colored" if own else sampler, entry.presets)
    groups = settings_of(base, entry.model_of(entry.load_vehicle(base.vehicle)))
    return {s.name: s for group, found in groups.items() if not (own and group == "sampling") for s in found}


def entry_of(argv: Sequence[str]) -> SystemEntry:
    """The system that these words ask for: by --system, else by a course among them."""
    system = said(argv, "--system", "")
    if system and system not in SYSTEMS:
        raise UsageError(f"--system: no system {system!r}: {did_you_mean(system, SYSTEMS)}")
    courses = (system_of_course(word) for word in argv if not word.startswith("-"))
    return SYSTEMS[system or next((name for name in courses if name != "quadrotor"), "quadrotor")]


def said(argv: Sequence[str], name: str, default: str) -> str:
    """What argv says after this flag, the last time it does."""
    words = [w for arg in argv for w in (arg.split("=", 1) if arg.startswith(f"{name}=") else [arg])]
    values = [b for a, b in pairwise(words) if a == name]
    return values[-1] if values else default


def _typed_dict(settings: dict[str, Setting]) -> Any:
    """A type for cyclopts with one key for each setting, none required."""
    kinds: dict[str, Any] = {}
    for i, (group, title) in enumerate(TITLES.items()):
        shown = Group(title, sort_key=i)
        for s in (s for s in settings.values() if s.group == group):
            default = "" if s.default is None else f" [default: {_text(s.default)}]"
            parameter = Parameter(name=flag(s.name), group=shown, help=s.help + default, negative_iterable="")
            kinds[s.name] = Annotated[_words_of(s), parameter]
    return TypedDict("Settings", kinds, total=False)  # pyright: ignore


def _words_of(s: Setting) -> Any:
    """What follows the flag: nothing, one word or several. Values are judged later."""
    kind = bare(s.kind)
    if isinstance(kind, inspect.BoolType):
        return bool
    if s.name == "sampler":
        return Literal[tuple(SAMPLERS)] | str
    if isinstance(kind, inspect.TupleType | inspect.VarTupleType):
        return tuple[(X,) * len(s.default)]  # pyright: ignore
    if isinstance(kind, inspect.LiteralType):
        return Literal[tuple(kind.values)] | str
    return N if isinstance(kind, inspect.IntType) else X if isinstance(kind, inspect.FloatType) else str


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        return " ".join(map(_text, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _line(error: CycloptsError, app: App, settings: dict[str, Setting]) -> str:
    """cyclopts' error in our words."""
    name = error.argument.name if error.argument else ""
    match error:
        case UnknownOptionError():
            word = (error.token.keyword or error.token.value).partition("=")[0]
            known = [n for argument in app.assemble_argument_collection() for n in argument.names]
            return f"no flag {word}: {did_you_mean(word, known)}"
        case UnusedCliTokensError():
            return f"unexpected {' '.join(map(repr, error.unused_tokens or ()))}"
        case RepeatArgumentError():
            return f"{name or error.token.keyword}: expected once, got it twice"
        case CoercionError() | MissingArgumentError():
            came = repr(error.token.value) if isinstance(error, CoercionError) and error.token else "too few values"
            setting = settings.get(name.removeprefix("--").replace("-", "_"))
            if setting and isinstance(setting.default, tuple):
                return f"{name}: expected {len(setting.default)} numbers, got {came}"
            hint: Any = setting.kind if setting else inspect.type_info(_hint(error))
            return f"{name}: expected {expected(hint)}, got {came}"
    return str(error).splitlines()[-1]


def _hint(error: CycloptsError) -> Any:
    hint = error.argument.hint if error.argument else str
    return hint if hint is not Argument.empty else str


__all__ = ["FileError", "Given", "Help", "Json", "RunsDir", "Stored", "UsageError", "check", "flag", "run_command"]
