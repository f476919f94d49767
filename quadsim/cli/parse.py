"""Parse the command line: the command, its arguments, and one line for an error."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from functools import cache
from itertools import pairwise
from typing import Any, get_type_hints

from cyclopts import App, CycloptsError, exceptions
from msgspec import inspect

from quadsim.cli.commands import COMMANDS
from quadsim.cli.flags import settings_as_flags
from quadsim.config.settings import SETTINGS, bare
from quadsim.console import UsageError
from quadsim.files.values import NONE, checked, wanted

MANY_RACES = "use race compare-heats with --entrants, --starts and --variants for many races"
# command -> what to do with arguments that it has no use for
BEHIND_A_FLAG = {"heat": "entrants stand behind --entrants"}
JOINED = re.compile(r"[-+.\deE]+(:[-+.\deE]+)+")  # numbers, joined by colons
# (command, flag) -> what to use in place of a flag that another command has
MOVED = {("heat", "--starts"): MANY_RACES, ("compare", "--line-up"): MANY_RACES}


@cache
def application() -> App:
    """Return the commands as a cyclopts App, which loads the module of a command on use."""
    app = App(name="race", version_flags=(), help_flags=("--help", "-h"), help_format="plaintext")
    for name, command in COMMANDS.items():
        app.command(command.function, name=name)
    return app


def numbers_apart(argv: Sequence[str]) -> list[str]:
    """Return a command line in which a setting of several numbers has as many words.

    Variants and sweeps join such numbers by colons, so users write 0:0:0:0 behind a flag, too.
    "none" stands for all numbers.
    """
    found: list[str] = []
    for before, word in pairwise(("", *argv)):
        setting = SETTINGS.get(before.removeprefix("--").replace("-", "_"))
        if not before.startswith("--") or setting is None:
            found.append(word)
        elif JOINED.fullmatch(word):
            found += word.split(":")
        elif word == NONE:
            found += [word] * numbers_of(setting.kind)
        else:
            found.append(word)
    return found


def numbers_of(kind: inspect.Type) -> int:
    """Return how many numbers a setting of this kind takes."""
    one_kind = bare(kind)
    return len(one_kind.item_types) if isinstance(one_kind, inspect.TupleType) else 1


def run(argv: Sequence[str]) -> int:
    """Run the command line and return its exit code; 0 for `--help`.

    Raises:
        UsageError: flags or values that cannot be used.
    """
    app = application()
    try:
        function, bound, _ = app.parse_args(
            numbers_apart(argv), print_error=False, exit_on_error=False
        )
    except CycloptsError as error:
        raise UsageError(_line(error, app[argv[0]])) from None
    if hasattr(function, "__self__"):  # a method of the App itself: --help, completion
        function(*bound.args, **bound.kwargs)
        return 0
    _check(function, bound.arguments)
    return function(*bound.args, **bound.kwargs)


def _check(function: Callable[..., Any], arguments: Mapping[str, Any]) -> None:
    """Check a command's own flags by their annotations. Raises UsageError."""
    hints = get_type_hints(function, include_extras=True)
    for name, value in arguments.items():
        if isinstance(value, int | float | str) and not isinstance(value, bool):
            kind = inspect.type_info(hints[name])
            if isinstance(value, str) and not isinstance(bare(kind), inspect.StrType):
                continue
            with settings_as_flags():
                checked(name, value, kind)


def _line(error: CycloptsError, app: App) -> str:
    """Return cyclopts' error as one line: the flag, the expected and the given value."""
    name = error.argument.name if error.argument else ""
    command = " ".join(app.name)
    match error:
        case exceptions.UnknownOptionError():
            given = (error.token.keyword or error.token.value).partition("=")[0]
            arguments = app.assemble_argument_collection()
            known = [n for argument in arguments for n in argument.names if n.startswith("--")]
            moved = MOVED.get((command, given))
            if moved:
                return f"no flag {given}: {moved}"
            near = get_close_matches(given, known, n=1)
            advice = f": did you mean {near[0]!r}?" if near else ""
            return f"no flag {given}{advice} (see race {command} --help)"
        case exceptions.UnusedCliTokensError():
            unused = " ".join(map(repr, error.unused_tokens or ()))
            advice = f": {BEHIND_A_FLAG[command]}" if command in BEHIND_A_FLAG else ""
            return f"unexpected {unused}{advice} (see race {command} --help)"
        case exceptions.RepeatArgumentError():
            return f"{error.token.keyword}: expected once, got it twice"
        case exceptions.CoercionError() | exceptions.MissingArgumentError() if error.argument:
            token = error.token if isinstance(error, exceptions.CoercionError) else None
            setting = SETTINGS.get(name.removeprefix("--").replace("-", "_"))
            kind = setting.kind if setting else inspect.type_info(error.argument.hint)
            text = wanted(kind, may_be_off=setting is not None and setting.group != "flight")
            if token is not None:
                return f"{name}: expected {text}, got {token.value!r}"
            is_missing = isinstance(error, exceptions.MissingArgumentError) and not error.keyword
            given = " ".join(getattr(error, "tokens_so_far", ()))
            few = f"too few values: {given!r}" if given else "too few values"
            got = f"no {name}" if is_missing else few
            return f"{name}: expected {text}, got {got} (see race {command} --help)"
    return str(error).splitlines()[-1]
