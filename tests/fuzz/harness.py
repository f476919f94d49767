"""Commands with seeded damage, each in a process forked from one that has loaded everything, and
what they may do.

No traceback, no hang, only documented exit codes, one line of plain text for an error; what each
case claims besides (nothing half-written that looks finished) is checked by its `after`.
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

HANG = 60.0  # [s]; on a machine that does other things too, of processor time or of doing nothing
# [s] of the clock on the wall, and as many times longer as programs wait for each processor
LATEST = 300.0
# finished, not finished, usage or bad file, interrupted, the reader of a pipe has left
CODES = {0, 1, 2, 130, 141}
# [bytes] of address space: what reads without an end fails before the machine does
MEMORY = 8 << 30
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
RACE = "import sys; from quadsim.cli.cli import main; main()"


@dataclass(frozen=True)
class Said:
    """What a command left: its exit code (None: it was killed for hanging), and what it wrote."""

    code: int | None
    out: str
    err: str


@dataclass(frozen=True)
class Case:
    """One command in a folder of its own.

    prepare(folder): makes what is damaged; after(folder, said): what is wrong besides, or "".
    codes: exit codes that are right here. fsize: largest file that may be written [bytes], as on a
    disk that fills.
    env: other variables, {here} in them is the folder; closed: streams without a file (0, 1, 2).
    fresh: in an interpreter of its own, as libraries read variables when they are loaded.
    call: in the place of a command, returns its exit code.
    """

    kind: str
    label: str
    argv: tuple[str, ...]
    prepare: Callable[[Path], object] = lambda _: None
    after: Callable[[Path, Said], str] = lambda *_: ""
    codes: frozenset[int] = field(default=frozenset(CODES))
    fsize: int | None = None
    env: dict[str, str] = field(default_factory=dict)
    fresh: bool = False
    call: Callable[[], int] | None = None
    closed: tuple[int, ...] = ()
    to: str | None = None  # the file that stdout is, for example /dev/full


def run(case: Case) -> str:
    """What is wrong with what the command did, or ""."""
    folder = Path(tempfile.mkdtemp(prefix="quadsim-fuzz-"))
    try:
        case.prepare(folder)
        said = _fresh(case, folder) if case.fresh else forked(case, folder)
        return wrong(case, said) or case.after(folder, said)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def wrong(case: Case, said: Said) -> str:
    """Against the rules that hold for every command."""
    text = said.err + said.out
    if said.code is None:
        return f"hangs: more than {HANG:g} s"
    if "Traceback" in text or "Exception ignored" in text:
        return f"traceback: {text.strip().splitlines()[-1]}"
    if said.code not in case.codes:
        return f"exit code {said.code}, expected {sorted(case.codes)}: {said.err[-200:]!r}"
    if found := CONTROL.search(said.err):
        return f"control character {found.group()!r} in stderr: {said.err[:200]!r}"
    lines = said.err.splitlines()
    if said.code == 2 and case.argv[:1] != ("check",) and 2 not in case.closed:
        if not lines:
            return "exit code 2 without a word"
        said_errors = [line for line in lines if line.startswith(("race ", "race:"))]
        if len(said_errors) != 1:
            return f"expected one line that says what is wrong, got {said.err[:300]!r}"
    return ""


def forked(case: Case, folder: Path, patience: int = 1) -> Said:
    """In a child of this process, in which all modules are loaded but no thread runs yet."""
    return _wait(
        start(case.argv, folder, partial(_limit, case, folder), case.call, case.to), patience
    )


def _limit(case: Case, folder: Path) -> None:
    """In the child."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if case.fsize is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (case.fsize, case.fsize))
    os.environ.update(_variables(case, folder))


def _wait(child: Child, patience: int) -> Said:
    """Until the child ends, or hangs: then it and what it started are killed."""
    began, pid = time.monotonic(), 0
    while not pid and not _hangs(child.pid, (time.monotonic() - began) / patience):
        time.sleep(0.005)
        pid, status = os.waitpid(child.pid, os.WNOHANG)
    child.kill_all()  # and workers that outlive their parent
    if not pid:
        os.waitpid(child.pid, 0)
    return Said(os.waitstatus_to_exitcode(status) if pid else None, *child.texts())


def _variables(case: Case, folder: Path) -> dict[str, str]:
    return {name: value.replace("{here}", str(folder)) for name, value in case.env.items()}


def _hangs(child: int, seconds: float) -> bool:
    """Whether it has computed for HANG, or has had HANG and computed next to nothing, or is
    LATEST."""
    if seconds < HANG:
        return False
    time.sleep(0.2)  # the processes of a machine are not read in haste
    return not 2.0 < _computed(child) < HANG or seconds > LATEST * waiting()


def _computed(session: int) -> float:
    """By a command and its workers [s]."""
    ticks = 0
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # ended meanwhile
            fields = path.read_text().rpartition(")")[2].split()
            ticks += int(fields[11]) + int(fields[12]) if int(fields[3]) == session else 0
    return ticks / os.sysconf("SC_CLK_TCK")


def _fresh(case: Case, folder: Path) -> Said:
    """With variables of its own, which libraries read when they are loaded."""
    command = [sys.executable, "-c", RACE, *case.argv]
    if case.closed:
        shut = " ".join(f"{i}{'<' if i == 0 else '>'}&-" for i in case.closed)
        command = ["sh", "-c", f'exec "$@" {shut}', "sh", *command]
    out = open(case.to, "w") if case.to else subprocess.PIPE  # noqa: SIM115
    env = {k: v for k, v in (os.environ | _variables(case, folder)).items() if v != "unset"}
    child = subprocess.Popen(
        command, cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.PIPE,
        text=True, errors="replace", start_new_session=True,
    )  # fmt: skip
    try:
        texts = child.communicate(timeout=LATEST * waiting())
    except subprocess.TimeoutExpired:
        os.killpg(child.pid, signal.SIGKILL)
        child.communicate()
        return Said(None, "", "")
    return Said(child.returncode, *(text or "" for text in texts))
