"""The fuzzers judge rightly, and the first cases of each find nothing; `make fuzz` tries many
more."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.fuzz import harness
from tests.fuzz.__main__ import CASES
from tests.fuzz.children import start
from tests.fuzz.harness import Case, Said, forked, run, wrong

ROOT = Path(__file__).parents[2]
FLY = Case("flags", "", ("fly",))
BAD = {
    "hangs": Said(None, "", ""),
    "traceback": Said(1, "", "Traceback (most recent call last):\nKeyError: 'x'\n"),
    "exit code 3": Said(3, "", ""),
    "control character": Said(2, "", "race fly: no course '\x1b[31m'\n"),
    "without a word": Said(2, "", ""),
    "expected one line": Said(2, "", "race fly: a\nrace fly: b\n"),
}


@pytest.mark.parametrize("problem", BAD)
def test_what_no_command_may_do_is_found(problem):
    assert problem in wrong(FLY, BAD[problem])


def test_one_line_and_a_documented_exit_code_are_right():
    assert wrong(FLY, Said(2, "", "race fly: no course 'x'\n")) == ""
    assert wrong(FLY, Said(1, "a report", "compiling\n")) == ""


def fails():
    raise KeyError("x")


def killed():
    os.kill(os.getpid(), signal.SIGKILL)


def writes():
    Path("big").write_bytes(bytes(1000))
    return 0


def test_a_command_that_fails_is_seen_from_outside(tmp_path):
    assert run(Case("calls", "", (), call=fails)) == "traceback: KeyError: 'x'"
    assert run(Case("calls", "", (), call=killed)).startswith("exit code -9")
    assert run(Case("calls", "", (), call=writes)) == ""
    assert forked(Case("calls", "", (), call=writes, fsize=100), tmp_path).code == 1
    assert (tmp_path / "big").stat().st_size == 100


def idles():
    time.sleep(60.0)
    return 0


def test_a_command_that_does_nothing_hangs(tmp_path, monkeypatch):
    monkeypatch.setattr(harness, "HANG", 0.5)
    assert forked(Case("calls", "", (), call=idles), tmp_path).code is None


def worker_computes():
    if not (worker := os.fork()):
        while time.process_time() < 0.3:
            pass
        Path("computed").touch()
        time.sleep(60.0)
    os.waitpid(worker, 0)
    return 0


def test_what_workers_compute_counts_as_the_commands(tmp_path):
    child = start((), tmp_path, call=worker_computes)
    while not (tmp_path / "computed").exists():
        time.sleep(0.02)
    assert harness._computed(child.pid) > 0.2
    child.kill_all()
    assert child.finish()[0] == -signal.SIGKILL


def test_the_first_cases_of_every_fuzzer_find_nothing():
    command = [sys.executable, "-m", "tests.fuzz", "--first", "2", "--jobs", "1"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"{2 * len(CASES)} cases     0 failed" in done.stdout
