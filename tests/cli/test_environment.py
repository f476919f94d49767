"""Variables that a library cannot use, closed streams: one plain line, a documented exit code."""

import os
import subprocess
import sys
import warnings

import pytest

from quadsim import console
from quadsim.cli.cli import race
from quadsim.console import progress_console
from tests.campaign_cases import RACE

# Variable -> a value that numba reads with an error, and one that it cannot work with
UNFIT = {"NUMBA_DISABLE_JIT": "1", "NUMBA_NUM_THREADS": "0"}


@pytest.mark.process
@pytest.mark.parametrize(
    "name", ["NUMBA_DISABLE_JIT", pytest.param("NUMBA_NUM_THREADS", marks=pytest.mark.regression)]
)
def test_what_numba_cannot_use_is_one_line_that_names_the_variable(name, tmp_path):
    env = os.environ | {name: UNFIT[name]}
    done = subprocess.run(
        [*RACE, "fly"], env=env, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith(f"race fly: {name}='{UNFIT[name]}': ")
    assert list(tmp_path.iterdir()) == []


def test_numba_variables_that_it_can_use_are_no_complaint(monkeypatch, capsys):
    monkeypatch.setenv("NUMBA_NUM_THREADS", str(os.cpu_count()))
    assert race(["fly", "split_s_swfit"]) == 2
    assert "NUMBA" not in capsys.readouterr().err


def test_help_needs_no_compiler(monkeypatch, capsys):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert race(["fly", "--help"]) == 0
    assert capsys.readouterr().err == ""


def test_a_pipe_gets_no_moving_line_though_colours_are_forced(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert not progress_console().is_terminal


@pytest.mark.process
def test_closed_streams_change_neither_exit_code_nor_files(tmp_path):
    """The next file that is opened would get the number of a closed stream, and its output."""
    (tmp_path / "mine.yaml").write_text("gates: 3\n")
    command = ["sh", "-c", 'exec "$@" <&- >&- 2>&-', "sh", *RACE, "check", "mine.yaml"]
    assert subprocess.run(command, cwd=tmp_path, check=False).returncode == 2
    assert (tmp_path / "mine.yaml").read_text() == "gates: 3\n"


@pytest.mark.process
def test_matplotlib_is_loaded_whatever_backend_the_variable_names():
    code = """
from quadsim.console import prepare_process
prepare_process()
import matplotlib.figure
print(matplotlib.get_backend())
"""
    env = os.environ | {"MPLBACKEND": "no such backend"}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "agg\n"), done.stderr


def test_a_warning_of_a_library_is_one_line(capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = console._show_warning
        warnings.warn("\x1b[1mone\ntwo", stacklevel=1)
    assert capsys.readouterr().err == "warning: one\n"
