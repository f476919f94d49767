"""`race`: a table of commands, each a dataclass of flags with run() in a module that is loaded when asked for."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module, metadata
from typing import Any

COMMANDS = {  # name -> where its flags and its run() are, what it does
    "fly": ("quadsim.app.fly:Fly", "fly a course: laps, splits, crashes, chatter, plan time"),
    "show": ("quadsim.app.show:Show", "the report of a stored run"),
    "plot": ("quadsim.app.show:Plot", "a stored run as a picture: path, height, controls, spectrum"),
    "web": ("quadsim.app.web:Web", "watch, tune, race ghosts and replay in a browser"),
    "export": ("quadsim.app.export:Export", "a stored run as a page that plays offline, as CSV, as a zip"),
    "courses": ("quadsim.app.listing:Courses", "the courses that come with the project"),
    "vehicles": ("quadsim.app.listing:Vehicles", "the vehicles that come with the project"),
    "bench": ("quadsim.app.bench.bench:Bench", "time control steps on this machine, beside its limits and its peers"),
    "compare": ("quadsim.app.campaign.compare:Compare", "arms against each other: many flights, paired by seed, kept"),
    "results": ("quadsim.app.campaign.results:Results", "what campaigns have stored: list, filter, compare"),
    "tune": ("quadsim.app.campaign.tune:Tune", "search a planner's numbers for the fastest safe lap"),
    "regress": ("quadsim.app.campaign.regress:Regress", "has the racer got slower, less safe, less smooth?"),
    "check": ("quadsim.app.check:Check", "check course, vehicle and preset files"),
    "paper": ("quadsim.app.paper.command:Paper", "the paper's tables and figures, rerun"),
}
HELP = """usage: race COMMAND [FLAGS]

Quadrotor racing in PyBullet, flown by MPPI with Gaussian or colored sampling.

{commands}

A command's flags: race COMMAND --help. JSON: --json. Examples:
  race fly                     the main job: the Split-S course, three laps
  race fly paper_flat --preset paper --sampler gaussian --seed 3
  race plot last               the last run as PNG and SVG

Version: race --version. Completion: source the output of
race --tyro-print-completion bash (or zsh, tcsh, fish).
Exit code: 0 finished, 1 not finished, 2 usage or bad file, 130 interrupted.
"""
PIPE_CLOSED = 128 + signal.SIGPIPE  # what a shell reports for a program that the signal has ended


def main() -> None:
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # like Ctrl-C
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name) or open(os.devnull, "w")  # noqa: SIM115 (`>&-` closes it; it lives to the end)
        stream.reconfigure(errors="replace")  # an ASCII terminal gets question marks
        setattr(sys, name, stream)
    sys.exit(race(sys.argv[1:]))


def race(argv: list[str]) -> int:
    """The exit code. Whatever a user can cause is one line on stderr."""
    name, rest = (argv[0], argv[1:]) if argv else ("--help", [])
    try:
        if name in COMMANDS:
            return _run(name, rest)
        return _about(name, argv)
    except BrokenPipeError:  # `race courses | head -1`
        _drop_stdout()
        return PIPE_CLOSED
    except OSError as error:  # `race courses > /dev/full`
        _drop_stdout()
        return _complain(f"race {name}: {error.filename or 'stdout'}: {error.strerror}", 2)
    except KeyboardInterrupt:
        return _complain(f"race {name}: interrupted, nothing to keep", 130)


def _run(name: str, argv: list[str]) -> int:
    from quadsim.app.flags import UsageError, read
    from quadsim.files.strict_yaml import FileError
    from quadsim.record.run import RunError

    try:
        flags = _flags(name)
        if hasattr(flags, "from_argv"):  # it hands flags of `fly` on
            return flags.from_argv(argv).run()
        default = flags.defaults(argv) if hasattr(flags, "defaults") else None
        return read(flags, f"race {name}", argv, default).run()
    except (UsageError, FileError, RunError) as error:
        return _complain(f"race {name}: {error}", 2)


def _flags(name: str) -> Any:
    module, _, attribute = COMMANDS[name][0].partition(":")
    return getattr(import_module(module), attribute)


def _about(name: str, argv: list[str]) -> int:
    if name in ("-h", "--help"):
        commands = "\n".join(f"  {name:<10}{what}" for name, (_, what) in COMMANDS.items())
        print(HELP.format(commands=commands), end="", flush=True)
        return 0
    if name == "--version":
        print(f"race {metadata.version('quadsim')}", flush=True)
        return 0
    if name.replace("_", "-") in ("--tyro-print-completion", "--tyro-write-completion"):
        return _completion(argv)
    from quadsim.files.yaml_words import did_you_mean

    return _complain(f"race: no command {name!r}: {did_you_mean(name, COMMANDS)} (race --help)", 2)


def _completion(argv: list[str]) -> int:
    """tyro's script for the shell, from the flags of all commands."""
    from tyro.extras import subcommand_cli_from_dict

    shells = ("bash", "zsh", "tcsh", "fish")
    if len(argv) < 2 or argv[1] not in shells:
        return _complain(f"race: {argv[0]}: expected one of {', '.join(shells)}", 2)
    subcommand_cli_from_dict({name: _flags(name) for name in COMMANDS}, prog="race", args=argv)
    return 0


def _drop_stdout() -> None:
    """What is still buffered goes nowhere, or Python would try again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(line: str, code: int) -> int:
    print(line, file=sys.stderr, flush=True)
    return code
