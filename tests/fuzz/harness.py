"""Commands with seeded damage, each in a process forked from one that has loaded everything, and what they may do.

No traceback, no hang, only documented exit codes, one line of plain text for an error; what each case claims besides
(nothing half-written that looks finished) is checked by its `after`.
"""

from __future__ import annotations

import fcntl
import multiprocessing as mp
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

HANG = 60.0  # [s]; on a machine that does other things too, of processor time or of doing nothing
LATEST = 300.0  # [s] of the clock on the wall
CODES = {0, 1, 2, 130, 141}  # finished, not finished, usage or bad file, interrupted, the reader of a pipe has left
MEMORY = 8 << 30  # [bytes] of address space: what reads without an end fails before the machine does
PIPE = 1 << 20  # bytes that a command may print before anyone reads
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")
RACE = "import sys; from quadsim.app.cli import main; main()"


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
    codes: exit codes that are right here. fsize: largest file that may be written [bytes], as on a disk that fills.
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
    pipes = [os.pipe() for _ in range(2)]
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if not child:
        _child(case, folder, pipes)
    for read, write in pipes:
        os.close(write)
        fcntl.fcntl(read, fcntl.F_SETPIPE_SZ, PIPE)
    return _wait(child, [read for read, _ in pipes], patience)


def _child(case: Case, folder: Path, pipes: list[tuple[int, int]]) -> None:
    """Never returns. The exit code of an exception that nobody caught is Python's, 1."""
    code = 1
    try:
        from quadsim.app.cli import main

        mp.current_process()._config["daemon"] = False  # as a member of a pool it could start no workers
        os.setsid()
        os.chdir(folder)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        streams = [os.open(os.devnull, os.O_RDONLY), *(write for _, write in pipes)]
        if case.to:
            streams[1] = os.open(case.to, os.O_WRONLY | os.O_CREAT)
        for to, stream in enumerate(streams):
            os.dup2(stream, to)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        if case.fsize is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (case.fsize, case.fsize))
        sys.stdin, sys.stdout, sys.stderr = (open(i, "r" if i == 0 else "w") for i in range(3))  # noqa: SIM115
        sys.argv = ["race", *case.argv]
        os.environ.update(_variables(case, folder))
        code = case.call() if case.call else main()  # main() ends by SystemExit
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(Exception):
                stream.flush()
        os._exit(code)


def _wait(child: int, reads: list[int], patience: int) -> Said:
    """Until the child ends, or hangs: then it and what it started are killed."""
    began, pid = time.monotonic(), 0
    while not pid and not _hangs(child, (time.monotonic() - began) / patience):
        time.sleep(0.005)
        pid, status = os.waitpid(child, os.WNOHANG)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # and workers that outlive their parent
    if not pid:
        os.waitpid(child, 0)
    texts = []
    for read in reads:
        with open(read, "rb") as pipe:
            texts.append(pipe.read().decode(errors="replace"))
    return Said(os.waitstatus_to_exitcode(status) if pid else None, *texts)


def _variables(case: Case, folder: Path) -> dict[str, str]:
    return {name: value.replace("{here}", str(folder)) for name, value in case.env.items()}


def _hangs(child: int, seconds: float) -> bool:
    """Whether it has computed for HANG, or has had HANG and computed next to nothing, or is LATEST."""
    if seconds < HANG:
        return False
    fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
    computed = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return not 2.0 < computed < HANG or seconds > LATEST


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
        texts = child.communicate(timeout=LATEST)
    except subprocess.TimeoutExpired:
        os.killpg(child.pid, signal.SIGKILL)
        child.communicate()
        return Said(None, "", "")
    return Said(child.returncode, *(text or "" for text in texts))
