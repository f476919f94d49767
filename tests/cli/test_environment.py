"""Variables that a library cannot use and streams that are closed: one plain line, a documented
exit code."""

import os
import subprocess
import sys

import pytest

from quadsim.cli.cli import race
from quadsim.console import progress_console

RACE = [sys.executable, "-c", "from quadsim.cli.cli import main; main()"]
UNFIT = {  # variable -> its value
    "NUMBA_DISABLE_JIT": "1",
    "NUMBA_NUM_THREADS": "0",
    "NUMBA_OPT": "x",
    "NUMBA_THREADING_LAYER": "foo",
}


@pytest.mark.parametrize("name", UNFIT)
@pytest.mark.parametrize("command", ["fly"])
def test_what_numba_cannot_use_is_one_line_that_names_the_variable(name, command, tmp_path):
    env = os.environ | {name: UNFIT[name]}
    done = subprocess.run(
        [*RACE, command], env=env, cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith(f"race {command}: {name}='{UNFIT[name]}': ")
    assert list(tmp_path.iterdir()) == []


def test_numba_variables_that_it_can_use_are_no_complaint(monkeypatch, capsys):
    monkeypatch.setenv("NUMBA_NUM_THREADS", str(os.cpu_count()))
    assert race(["fly", "split_s_swfit"]) == 2
    assert "no course 'split_s_swfit'" in capsys.readouterr().err


def test_help_needs_no_compiler(monkeypatch, capsys):
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert race(["fly", "--help"]) == 0
    assert capsys.readouterr().err == ""


def test_a_pipe_gets_no_moving_line_though_colours_are_forced(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert not progress_console().is_terminal


CLOSED = {"stdin": "<&-", "stdout": ">&-", "stderr": "2>&-", "all": "<&- >&- 2>&-"}


@pytest.mark.parametrize("closed", CLOSED.values(), ids=CLOSED)
def test_closed_streams_change_neither_exit_code_nor_files(closed, tmp_path):
    """Where one is closed, the next file that is opened would get its number, and the output."""
    (tmp_path / "mine.yaml").write_text("gates: 3\n")
    for words, code in ((["courses"], 0), (["check", "mine.yaml"], 2), (["show"], 2)):
        command = ["sh", "-c", f'exec "$@" {closed}', "sh", *RACE, *words]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == code
        assert "Traceback" not in done.stderr
    assert (tmp_path / "mine.yaml").read_text() == "gates: 3\n"


def test_matplotlib_is_loaded_whatever_backend_the_variable_names(tmp_path):
    code = (
        "from quadsim.console import prepare_process; prepare_process(); import matplotlib.figure"
    )
    env = os.environ | {"MPLBACKEND": "no such backend"}
    subprocess.run([sys.executable, "-c", code], env=env, check=True)


def test_a_warning_of_a_library_is_one_line():
    code = "from quadsim.console import prepare_process as p; p(); import warnings; warnings.warn('\\x1b[1mone\\ntwo')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr == "warning: one\n"
