"""`race`: a table of commands, each a function in a module that is loaded when it is asked for."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from importlib import import_module, metadata

from quadsim.cli.completion import COMPLETE, SHELLS, candidates, script

COMMANDS = {  # name -> module and function, what it does
    "fly": ("quadsim.cli.fly:fly", "simulate a flight: lap and split times, crashes, chatter"),
    "show": ("quadsim.cli.stored:show", "the report of a stored run"),
    "plot": (
        "quadsim.cli.stored:plot",
        "a stored run as a picture: path, height, controls, spectrum",
    ),
    "web": ("quadsim.cli.web:web", "watch, tune, race and replay in a browser"),
    "render": (
        "quadsim.cli.render:render",
        "pictures with labels for perception: colour, depth, segmentation",
    ),
    "export": (
        "quadsim.cli.stored:export",
        "a stored run as a page that plays offline, as CSV, as a zip",
    ),
    "courses": ("quadsim.cli.listing:courses", "the courses that come with the project"),
    "vehicles": ("quadsim.cli.listing:vehicles", "the vehicles that come with the project"),
    "sensings": ("quadsim.cli.listing:sensings", "the sets of sensors that come with the project"),
    "check": ("quadsim.cli.listing:check", "check course, vehicle, preset and sensing files"),
    "limit": (
        "quadsim.cli.limit:limit",
        "the least time in which a vehicle can fly a course, by optimisation",
    ),
    "compare": (
        "quadsim.campaign.compare:compare_command",
        "compare variants over many flights, paired by seed",
    ),
    "results": ("quadsim.campaign.results:results", "stored comparisons: list, filter, compare"),
    "tune": ("quadsim.campaign.tune:tune", "search planner parameters for the fastest safe lap"),
    "train": ("quadsim.cli.train:train", "learn a pilot for a course, flown by race fly --pilot"),
    "regress": (
        "quadsim.campaign.regress:regress",
        "regression test for lap times, success and chatter",
    ),
    "bench": (
        "quadsim.cli.bench:bench",
        "planning time on this machine; compare with pytorch-mppi and JAX",
    ),
    "paper": ("quadsim.cli.paper:paper", "reproduce the paper's tables and figures"),
}
HELP = """usage: race COMMAND [FLAGS]

Quadrotor racing in PyBullet, flown by Model Predictive Path Integral control
(MPPI) with Gaussian or colored sampling.

{commands}

A command's flags: race COMMAND --help. JSON: --json. Examples:
  race fly                     the Split-S course, three laps
  race fly paper_flat --preset paper --sampler gaussian --seed 3
  race plot last               the last run as PNG and SVG

Version: race --version. Completion: source the output of
race --completion bash (or zsh, fish).
Exit code: 0 finished, 1 not finished, 2 usage or bad file, 130 interrupted.
"""
COMPILES = ("fly", "web", "compare", "tune", "train", "regress", "bench", "paper")
PIPE_CLOSED = 128 + signal.SIGPIPE  # what a shell reports for a program that the signal has ended


def main() -> None:
    """The console script."""
    from quadsim.console import prepare_process

    prepare_process()
    sys.path.append("")  # "--sampler module:Class" may lie in the current folder
    sys.exit(race(sys.argv[1:]))


def race(argv: list[str]) -> int:
    """The exit code. Whatever a user can cause is one line on stderr."""
    name, rest = (argv[0], argv[1:]) if argv else ("--help", [])
    try:
        return _run(name, rest) if name in COMMANDS else _about(name, rest)
    except BrokenPipeError:  # `race courses | head -1`
        _drop_stdout()
        return PIPE_CLOSED
    except OSError as error:  # `race courses > /dev/full`
        _drop_stdout()
        return _complain(f"race {name}: {error.filename or 'stdout'}: {error.strerror}", 2)
    except KeyboardInterrupt as stop:
        return _complain(str(stop) or f"race {name}: interrupted, nothing to keep", 130)


def _run(name: str, argv: list[str]) -> int:
    from quadsim.cli.flags import run_command
    from quadsim.console import UsageError
    from quadsim.files.strict_yaml import FileError
    from quadsim.record.run import RunError

    try:
        if (
            name in COMPILES
            and not {"-h", "--help"} & set(argv)
            and any(v.startswith("NUMBA_") for v in os.environ)
        ):
            from quadsim.cli.fly import check_compiler

            check_compiler()
        return run_command(_command(name), f"race {name}", argv)
    except (UsageError, FileError, RunError) as error:
        return _complain(f"race {name}: {error}", 2)


def _command(name: str) -> Callable[..., int]:
    module, _, attribute = COMMANDS[name][0].partition(":")
    return getattr(import_module(module), attribute)


def _about(name: str, rest: list[str]) -> int:
    if name in ("-h", "--help"):
        commands = "\n".join(f"  {name:<10}{what}" for name, (_, what) in COMMANDS.items())
        print(HELP.format(commands=commands), end="", flush=True)
        return 0
    if name == "--version":
        print(f"race {metadata.version('quadsim')}", flush=True)
        return 0
    if name == "--completion" and rest[:1] in [[shell] for shell in SHELLS]:
        print(script(rest[0]), flush=True)
        return 0
    if name == "--completion":
        return _complain(f"race: --completion: expected one of {', '.join(SHELLS)}", 2)
    if name == COMPLETE:
        print(*(f"{word}\n" for word in candidates(rest, COMMANDS)), sep="", end="", flush=True)
        return 0
    from quadsim.files.yaml_words import did_you_mean

    return _complain(f"race: no command {name!r}: {did_you_mean(name, COMMANDS)} (race --help)", 2)


def _drop_stdout() -> None:
    """What is still buffered goes nowhere, or Python would try again at its end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _complain(line: str, code: int) -> int:
    from quadsim.console import complain

    complain(line)
    return code
