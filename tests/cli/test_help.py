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
from quadsim.cli.parse import numbers_apart
from quadsim.config.settings import SETTINGS


def outcome(argv, capsys):
    """Exit code, stdout, stderr."""
    return race(argv.split()), *capsys.readouterr()


@pytest.mark.parametrize("argv", ["courses", "vehicles", "--version", "--help"])
def test_listings_answer_on_stdout_in_80_columns(argv, capsys):
    code, out, err = outcome(argv, capsys)
    assert (code, err) == (0, "")
    assert all(len(line) <= 80 and line == line.rstrip() for line in out.splitlines())


def test_help_names_each_command_in_a_column_of_its_own(capsys):
    _, out, _ = outcome("--help", capsys)
    lines = {line.split()[0]: line for line in out.splitlines() if line.startswith("  ")}
    summaries = {name: command.summary for name, command in COMMANDS.items()}
    columns = {name: lines[name].find(f"  {summary}") for name, summary in summaries.items()}
    assert len(set(columns.values())) == 1
    assert all(columns[name] >= len(f"  {name}") for name in COMMANDS)


@pytest.mark.parametrize(("argv", "name"), [("courses", "split_s_swift"), ("vehicles", "swift")])
def test_listings_are_json_for_programs(argv, name, capsys):
    code, out, err = outcome(f"{argv} --json", capsys)
    assert (code, err) == (0, "")
    assert name in {entry["name"] for entry in json.loads(out)}


@pytest.mark.slow
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


@pytest.mark.slow
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
    ["plot", "-h"],
    ["compare", "--help"],
]
SLOW = {"numba", "pybullet", "matplotlib", "scipy.stats", "scipy.signal", "viser"}
LOADED = f"""
import sys
from contextlib import redirect_stdout
from io import StringIO
from quadsim.cli.cli import race
for argv in {QUICK}:
    with redirect_stdout(StringIO()):
        assert race(argv) == 0
    print(*sys.modules)
"""


@pytest.mark.process
def test_quick_commands_load_nothing_slow():
    done = subprocess.run([sys.executable, "-c", LOADED], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    for argv, line in zip(QUICK, done.stdout.splitlines(), strict=True):
        loaded = set(line.split())
        # The special functions of SciPy alone take 60 ms.
        slow = SLOW if argv[0] == "compare" else {*SLOW, "scipy"}
        assert not slow & loaded, argv
        assert "quadsim.cli.cli" in loaded


@pytest.mark.process
def test_the_list_of_commands_loads_no_numpy():
    """NumPy takes as long as all else that the list needs."""
    code = "import sys; from quadsim.cli.cli import main; sys.argv = ['race', '--help']; main()"
    command = [sys.executable, "-X", "importtime", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert "quadsim.console" in loaded
    assert "numpy" not in loaded


def test_a_required_flag_that_is_left_out_is_told_from_one_with_too_few_values(capsys):
    _, _, err = outcome("fit flight.csv", capsys)
    assert err == "race fit: --name: expected text, got no --name (see race fit --help)\n"
    _, _, err = outcome("fly figure8 --horizon", capsys)
    assert "--horizon: expected a whole number [steps] >= 2 and <= 10000, got too few values" in err


def test_entrants_without_their_flag_name_it(capsys):
    _, _, err = outcome("heat colored tiny=pilot=tiny.npz", capsys)
    assert err.startswith(
        "race heat: unexpected 'tiny=pilot=tiny.npz': entrants stand behind --ent"
    )


def test_numbers_that_are_joined_as_in_variants_are_read_behind_a_flag(capsys):
    line = "sweep figure8 --cutoff 0:0:0:0 --over gamma 0:0:0:0 --variants a=colored+cutoff=1:1:1:1"
    apart = line.replace("--cutoff 0:0:0:0", "--cutoff 0 0 0 0")
    assert numbers_apart(line.split()) == apart.split()
    none = numbers_apart(["fly", "--cutoff", "none", "--target-ess", "none", "none"])
    assert none == ["fly", "--cutoff", *["none"] * 4, "--target-ess", "none", "none"]
    _, _, err = outcome("fly figure8 --cutoff 0:0:0", capsys)
    asked = "--cutoff: expected 4 numbers [Hz] >= 0 and <= 1e+06, or none"
    assert f"{asked}, got too few values: '0 0 0'" in err
