"""Commands with seeded damage, and what no command may do.

A command runs in a process that is forked from one in which everything is loaded. It may not end in
a traceback or hang; its exit code is a documented one, and an error is one line of plain text. What
a case claims besides, for example that nothing half-written looks finished, its `after` checks.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from tests.fuzz.children import Child, start, waiting

# [s] of processor time, or of doing nothing, after which a command counts as hanging.
HANG = 60.0
# [s] of wall time, and as many times longer as programs wait for each processor.
LATEST = 300.0
# Finished, not finished, usage or bad file, interrupted, the reader of a pipe has left.
CODES = frozenset({0, 1, 2, 130, 141})
# [bytes] of address space: a command that reads without an end fails before the machine does.
MEMORY = 8 << 30
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
RACE = "import sys; from quadsim.cli.cli import main; main()"


@dataclass(frozen=True)
class Outcome:
    """The exit code of a command (None: it was killed for hanging), and what it has printed."""

    code: int | None
    out: str
    err: str


def nothing(_: Path) -> None:
    """Prepare nothing."""


def no_claim(_: Path, __: Outcome) -> str:
    """Claim nothing besides the rules that hold for every command."""
    return ""


@dataclass(frozen=True)
class Case:
    """One command in a folder of its own.

    Attributes:
        kind: the generator that made the case.
        label: what is damaged, and how.
        argv: the command.
        prepare: makes the damaged files in the folder.
        after: returns what is wrong with the folder and the outcome, or "".
        codes: exit codes that are right here.
        fsize: largest file that may be written [bytes], as on a disk that fills.
        env: environment variables; {here} in them is the folder.
        fresh: whether an interpreter of its own is needed, as libraries read variables when they
            are loaded.
        call: a function in place of a command; it returns the exit code.
        closed: numbers of the standard streams that are closed.
        to: the file that stdout is, for example /dev/full.
    """

    kind: str
    label: str
    argv: tuple[str, ...]
    prepare: Callable[[Path], object] = nothing
    after: Callable[[Path, Outcome], str] = no_claim
    codes: frozenset[int] = CODES
    fsize: int | None = None
    env: dict[str, str] = field(default_factory=dict)
    fresh: bool = False
    call: Callable[[], int] | None = None
    closed: tuple[int, ...] = ()
    to: str | None = None


def run(case: Case) -> str:
    """Return what is wrong with what the command did, or ""."""
    folder = Path(tempfile.mkdtemp(prefix="quadsim-fuzz-"))
    try:
        case.prepare(folder)
        outcome = _fresh(case, folder) if case.fresh else forked(case, folder)
        return wrong(case, outcome) or case.after(folder, outcome)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def wrong(case: Case, outcome: Outcome) -> str:
    """Return which rule that holds for every command is broken, or ""."""
    text = outcome.err + outcome.out
    if outcome.code is None:
        return f"hangs: more than {HANG:g} s"
    if "Traceback" in text or "Exception ignored" in text:
        return f"traceback: {text.strip().splitlines()[-1]}"
    if outcome.code not in case.codes:
        return f"exit code {outcome.code}, expected {sorted(case.codes)}: {outcome.err[-200:]!r}"
    control = CONTROL.search(outcome.err)
    if control:
        return f"control character {control.group()!r} in stderr: {outcome.err[:200]!r}"

    # `check` prints its findings to stdout, and a closed stderr shows nothing.
    if outcome.code != 2 or case.argv[:1] == ("check",) or 2 in case.closed:
        return ""
    lines = outcome.err.splitlines()
    if not lines:
        return "exit code 2 and no message"
    errors = [line for line in lines if line.startswith(("race ", "race:"))]
    if len(errors) != 1:
        return f"expected one line with the error, got {outcome.err[:300]!r}"
    return ""


def forked(case: Case, folder: Path, patience: int = 1) -> Outcome:
    """Run a case in a child of this process, in which all is loaded but no thread runs yet."""
    first = partial(_limit, case, folder)
    child = start(case.argv, folder, first=first, call=case.call, to=case.to)
    return _wait(child, patience)


def _limit(case: Case, folder: Path) -> None:
    """Set the limits and variables of a case; called in the child."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if case.fsize is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (case.fsize, case.fsize))
    os.environ.update(_variables(case, folder))


def _wait(child: Child, patience: int) -> Outcome:
    """Wait until the child ends. If it hangs, kill it and what it has started."""
    began = time.monotonic()
    pid, status = 0, 0
    while not pid and not _hangs(child.pid, (time.monotonic() - began) / patience):
        time.sleep(0.005)
        pid, status = os.waitpid(child.pid, os.WNOHANG)
    # Workers may outlive their parent.
    child.kill_all()
    if not pid:
        os.waitpid(child.pid, 0)
    code = os.waitstatus_to_exitcode(status) if pid else None
    return Outcome(code, *child.texts())


def _variables(case: Case, folder: Path) -> dict[str, str]:
    return {name: value.replace("{here}", str(folder)) for name, value in case.env.items()}


def _hangs(child: int, seconds: float) -> bool:
    """Return whether a child that has run for `seconds` hangs.

    It hangs if it has computed for HANG, or has computed next to nothing in that time, or if it is
    later than LATEST.
    """
    if seconds < HANG:
        return False
    # Reading all processes of the machine takes a while: not at every poll.
    time.sleep(0.2)
    return not 2.0 < _computed(child) < HANG or seconds > LATEST * waiting()


def _computed(session: int) -> float:
    """Return the processor time of a command and its workers [s]."""
    ticks = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        # The process may have ended meanwhile.
        with suppress(OSError):
            fields = path.read_text().rpartition(")")[2].split()
            if int(fields[3]) == session:
                ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def _fresh(case: Case, folder: Path) -> Outcome:
    """Run a case in an interpreter of its own."""
    command = [sys.executable, "-c", RACE, *case.argv]
    if case.closed:
        shut = " ".join(f"{i}{'<' if i == 0 else '>'}&-" for i in case.closed)
        command = ["sh", "-c", f'exec "$@" {shut}', "sh", *command]
    env = os.environ | _variables(case, folder)
    child = subprocess.Popen(
        command,
        cwd=folder,
        env={name: value for name, value in env.items() if value != "unset"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    try:
        out, err = child.communicate(timeout=LATEST * waiting())
    except subprocess.TimeoutExpired:
        os.killpg(child.pid, signal.SIGKILL)
        child.communicate()
        return Outcome(None, "", "")
    return Outcome(child.returncode, out or "", err or "")
