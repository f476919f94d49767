"""Completion for the shell: a few lines that ask `race --complete WORDS...` what may stand in the
last one's place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from inspect import Parameter, signature
from typing import Any

COMPLETE = "--complete"
SHELLS = {  # where nothing is proposed, files are
    "bash": """_race() { mapfile -t COMPREPLY < <(race --complete "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null); }
complete -o default -F _race race""",
    "zsh": """#compdef race
_race() {
  local -a found
  found=("${(@f)$(race --complete "${(@)words[2,CURRENT]}" 2>/dev/null)}")
  [[ -n "$found" ]] && compadd -a found || _files
}
compdef _race race""",
    "fish": "complete -c race -a '(race --complete (commandline -opc)[2..] (commandline -ct) 2>/dev/null)'",
}
ARGUMENTS = {  # command -> what its words name
    "fly": ("courses",), "compare": ("courses",), "tune": ("courses",), "limit": ("courses",),
    "check": ("courses", "vehicles", "sensings"), "show": ("runs",), "plot": ("runs",), "export": ("runs",),
    "web": ("runs",), "render": ("courses", "runs"), "paper": ("experiments",),
}  # fmt: skip
VALUES = {
    "--course": "courses", "--vehicle": "vehicles", "--sensing": "sensings", "--preset": "presets",
    "--variants": "samplers", "--camera": "cameras",
}  # fmt: skip


def script(shell: str) -> str:
    """What the shell is to source."""
    return SHELLS[shell]


def candidates(words: Sequence[str], commands: Mapping[str, tuple[str, str]]) -> list[str]:
    """What may stand in the place of the last word, which has been typed so far; words: after
    `race`."""
    *before, typed = words or [""]
    if not before:
        found: Iterable[str] = (*commands, "--help", "--version", "--completion")
    elif before[0] not in commands:
        found = SHELLS if before == ["--completion"] else ()
    elif typed.startswith("-"):
        found = _flags(before[0], commands, before)
    elif before[-1] in VALUES:
        found = _names(VALUES[before[-1]], before)
    elif before[-1].startswith("--") and (choices := _choices(before[-1], before)) is not None:
        found = choices
    else:
        found = [name for kind in ARGUMENTS.get(before[0], ()) for name in _names(kind, before)]
    return [name for name in found if name.startswith(typed)]


def _names(kind: str, words: Sequence[str]) -> Iterable[str]:
    """Of all that there is of a kind."""
    if kind == "courses":
        from quadsim.spec.systems import SYSTEMS

        return [name for entry in SYSTEMS.values() for name in entry.courses]
    if kind == "vehicles":
        from quadsim.vehicle import vehicle_names

        return vehicle_names()
    if kind == "sensings":
        from quadsim.sensing import sensing_names

        return sensing_names()
    if kind == "cameras":
        from quadsim.sensing.camera import camera_names

        return camera_names()
    if kind == "runs":
        from quadsim.cli.flags import last_said
        from quadsim.record.archive import list_runs

        return ["last", *(run.name for run in list_runs(last_said(words, "--runs-dir", "runs")))]
    if kind == "experiments":
        from quadsim.cli.paper import NAMES

        return NAMES
    from controllers.presets import PRESETS
    from controllers.samplers import SAMPLERS

    return SAMPLERS if kind == "samplers" else PRESETS


def _flags(
    command: str, commands: Mapping[str, tuple[str, str]], words: Sequence[str]
) -> list[str]:
    """The command's own, and those of the flight that the words so far ask for."""
    from quadsim.cli.flags import flag

    module, _, name = commands[command][0].partition(":")
    parameters = signature(getattr(import_module(module), name)).parameters.values()
    own = [p.name for p in parameters if p.kind is Parameter.KEYWORD_ONLY and p.name != "settings"]
    settings = _settings(words) if any(p.name == "settings" for p in parameters) else {}
    return [*map(flag, (*own, *settings)), "--help"]


def _choices(name: str, words: Sequence[str]) -> Iterable[str] | None:
    """The values of a flag of a flight: a sampler, one of several words, none for a number; None:
    it takes no value."""
    from msgspec import inspect

    from controllers.samplers import SAMPLERS
    from quadsim.cli.flags import flag
    from quadsim.spec.settings import bare

    setting = next((s for key, s in _settings(words).items() if flag(key) == name), None)
    if name == "--sampler":
        return SAMPLERS
    kind = bare(setting.kind) if setting else None
    if isinstance(kind, inspect.LiteralType):
        return [str(value) for value in kind.values]
    return None if isinstance(kind, inspect.BoolType) else ()


def _settings(words: Sequence[str]) -> dict[str, Any]:
    """Of a flight with these words, or of the default one where they cannot be used yet."""
    from quadsim.cli.flags import UsageError, flight_settings
    from quadsim.files.strict_yaml import FileError

    try:
        return flight_settings(words[1:])
    except (UsageError, FileError):
        return flight_settings(())
