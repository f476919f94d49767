"""`race`: the console script."""

from __future__ import annotations

import os
import signal
import sys
from importlib import metadata
from typing import Any

from quadsim.cli.commands import COMMANDS, GROUPS

HELP = """usage: race COMMAND [FLAGS]

Quadrotor races, flown by Model Predictive Path Integral control
(MPPI) with Gaussian or colored sampling.

{commands}

A command's flags: race COMMAND --help. JSON: --json. Examples:
  race fly                     the Split-S course, three laps
  race fly paper_flat --preset paper --sampler gaussian --seed 3
  race plot last               the last run as PNG and SVG

Version: race --version. Completion: race --completion bash > FILE, which
your shell sources at its start (or zsh, fish).
Exit code: 0 finished, 1 not finished, 2 usage or bad file, 130 interrupted.
"""
SHELLS = ("bash", "zsh", "fish")
COMPLETE = "__complete"  # request of the shell's completion script, answered by cyclopts
PIPE_CLOSED = 128 + signal.SIGPIPE  # exit code of a program that the signal has ended


def main() -> None:
    """Run the console script and exit with the command's code."""
    from quadsim.console import prepare_process

    prepare_process()
    sys.path.append("")  # "--sampler module:Class" may lie in the current folder
    sys.exit(race(sys.argv[1:]))


def race(argv: list[str]) -> int:
    """Run a command line and return its exit code.

    Every error that a user can cause is reported as one line on stderr.
    """
    argv = argv or ["--help"]
    name = argv[0]
    try:
        return _run(argv) if name in COMMANDS else _about(argv)
    except BrokenPipeError:  # `race courses | head -1`
        _drop_stdout()
        return PIPE_CLOSED
    except OSError as error:  # `race courses > /dev/full`
        _drop_stdout()
        return _complain(f"race {name}: {error.filename or 'stdout'}: {error.strerror}", 2)
    except KeyboardInterrupt as stop:
        return _complain(str(stop) or f"race {name}: interrupted", 130)


def _run(argv: list[str]) -> int:
    """Run a command and return its exit code."""
    from quadsim.cli.parse import run
    from quadsim.console import UsageError
    from quadsim.files.strict_yaml import FileError
    from quadsim.files.values import SettingError
    from quadsim.firmware.process import FirmwareError
    from quadsim.record.run import RunError

    name = argv[0]
    try:
        if COMMANDS[name].compiles and not {"-h", "--help"} & set(argv):
            _check_compiler()
        return run(argv)
    except (UsageError, FileError, SettingError, FirmwareError, RunError) as error:
        return _complain(f"race {name}: {error}", 2)
    except (OSError, KeyboardInterrupt):
        raise
    except Exception as error:
        # What the user's own code has raised is the user's to mend. Anything else is a fault of
        # this program, whose traceback helps.
        from quadsim.config.identity import error_text, place_in_own_code

        if place_in_own_code(error) is None:
            raise
        return _complain(f"race {name}: {error_text(error)}", 2)


def _check_compiler() -> None:
    """Raise UsageError if a NUMBA_ variable prevents the compilation of the planner."""
    if any(variable.startswith("NUMBA_") for variable in os.environ):
        from quadsim.cli.compiler import check_compiler

        check_compiler()


def _about(argv: list[str]) -> int:
    """Handle arguments that are not a command: help, version, completion."""
    name = argv[0]
    if name in ("-h", "--help"):
        print(HELP.format(commands=_listed()), end="", flush=True)
        return 0
    if name == "--version":
        print(f"race {metadata.version('quadsim')}", flush=True)
        return 0
    if name == "--completion":
        return _print_completion(argv[1:])
    if name == COMPLETE:
        from quadsim.cli.parse import run

        return run(argv)
    from quadsim.files.yaml_errors import did_you_mean

    return _complain(f"race: no command {name!r}: {did_you_mean(name, COMMANDS)} (race --help)", 2)


def _listed() -> str:
    """Return the commands with their summaries, by group."""
    width = max(map(len, COMMANDS))
    groups = []
    for title, commands in GROUPS.items():
        lines = [f"  {name:<{width}}  {command.summary}" for name, command in commands.items()]
        groups.append("\n".join([f"{title}:", *lines]))
    return "\n\n".join(groups)


def _print_completion(words: list[str]) -> int:
    """Print the completion script of a shell."""
    from quadsim.cli.parse import application

    if len(words) != 1 or words[0] not in SHELLS:
        return _complain(f"race: --completion: expected one of {', '.join(SHELLS)}", 2)
    shell: Any = words[0]
    print(application().generate_completion(shell=shell), flush=True)
    return 0


def _drop_stdout() -> None:
    """Discard buffered output, which Python would otherwise write again at its exit."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(line: str, code: int) -> int:
    """Print a line on stderr and return the exit code."""
    from quadsim.console import complain

    complain(line)
    return code
