"""Listings and help are complete, keep within a terminal's width, and come quickly."""

import json
import subprocess
import sys
from importlib import import_module
from typing import get_type_hints

import pytest
from cyclopts import Parameter

from quadsim.cli.cli import race
from quadsim.cli.commands import COMMANDS
from quadsim.spec.settings import SETTINGS


def outcome(argv, capsys):
    """Exit code, stdout, stderr."""
    return race(argv.split()), *capsys.readouterr()


@pytest.mark.parametrize(
    "argv", ["courses", "vehicles", "courses --json", "vehicles --json", "--version", "--help"]
)
def test_listings_answer_on_stdout(argv, capsys):
    code, out, err = outcome(argv, capsys)
    assert (code, err) == (0, "")
    assert all(
        len(line) <= 80 and line == line.rstrip()
        for line in out.splitlines()
        if "--json" not in argv
    )
    if "--json" in argv:
        assert {entry["name"] for entry in json.loads(out)} >= {"split_s_swift"} or "swift" in out


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_every_command_fits_a_terminal_and_says_what_each_flag_does(name, capsys):
    code, out, err = outcome(f"{name} --help", capsys)
    assert (code, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 80
    assert "[default: False]" not in out
    assert "[default: None]" not in out
    module, _, function = COMMANDS[name].function.partition(":")
    hints = get_type_hints(getattr(import_module(module), function), include_extras=True)
    flags = {
        k: getattr(hint, "__metadata__", ())
        for k, hint in hints.items()
        if k not in ("settings", "race", "return")
    }
    assert [
        k
        for k, notes in flags.items()
        if not any(isinstance(n, Parameter) and n.help for n in notes)
    ] == []


def test_every_setting_of_a_flight_is_a_flag_whatever_else_is_given(capsys):
    for argv in ("fly --help", "fly --sampler gaussian --preset paper --help"):
        code, out, _ = outcome(argv, capsys)
        assert code == 0
        assert [setting.flag for setting in SETTINGS.values() if setting.flag not in out] == []


QUICK = [
    ["--help"],
    ["courses"],
    ["check", "split_s_swift"],
    ["fly", "--help"],
    ["compare", "--help"],
    ["plot", "-h"],
]


@pytest.mark.parametrize("argv", QUICK, ids=" ".join)
def test_quick_commands_load_nothing_slow(argv):
    code = f"from quadsim.cli.cli import race; race({argv}); import sys; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    slow = {"numba", "pybullet", "matplotlib", "scipy.stats", "scipy.signal", "viser"}
    slow |= set() if argv[0] == "compare" else {"scipy"}  # its special functions alone take 60 ms
    assert not slow & set(loaded)
    assert "quadsim.cli.cli" in loaded
