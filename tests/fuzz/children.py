"""`race`, or a function, in a process forked from one that has loaded everything: no command waits
for imports."""

from __future__ import annotations

import fcntl
import multiprocessing as mp
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

PIPE = 1 << 20  # bytes that a command may print before anyone reads


@dataclass(frozen=True)
class Child:
    """A command on its way, in a session of its own, with what it writes to stdout and stderr."""

    pid: int
    reads: tuple[int, int]

    def finish(self) -> tuple[int, str, str]:
        """Exit code, stdout, stderr."""
        _, status = os.waitpid(self.pid, 0)
        self.kill_all()  # workers that outlive it would hold its streams
        return os.waitstatus_to_exitcode(status), *self.texts()

    def kill(self, patience: float) -> bool:
        """SIGKILL to it alone; whether its workers end too within so many seconds, else they are
        killed. Where the machine does other things too, it is so many times longer."""
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        ended = self._alone(patience)
        self.kill_all()
        for read in self.reads:
            os.close(read)
        return ended

    def _alone(self, patience: float) -> bool:
        until = time.monotonic() + patience * waiting()
        while time.monotonic() < until:
            try:
                os.killpg(self.pid, 0)
            except ProcessLookupError:
                return True
            time.sleep(0.02)
        return False

    def kill_all(self) -> None:
        """It and its workers."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)

    def texts(self) -> list[str]:
        """stdout, stderr, to their ends."""
        found = []
        for read in self.reads:
            with open(read, "rb") as pipe:
                found.append(pipe.read().decode(errors="replace"))
        return found


def waiting() -> float:
    """Programs that want a processor, for each that there is; at least 1."""
    return max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


def start(
    argv: Sequence[str],
    here: Path,
    first: Callable[[], object] = lambda: None,
    call: Callable[[], int] | None = None,
    to: str | None = None,
) -> Child:
    """`race` with these words in this folder, or `call` in its place, which returns the exit code.

    first: is called in the child, before the command. to: the file that stdout is.
    """
    pipes = [os.pipe() for _ in range(2)]
    sys.stdout.flush()
    sys.stderr.flush()
    if not (pid := os.fork()):
        _run(argv, here, first, call, [to or pipes[0][1], pipes[1][1]])
    for read, write in pipes:
        os.close(write)
        fcntl.fcntl(read, fcntl.F_SETPIPE_SZ, PIPE)
    return Child(pid, (pipes[0][0], pipes[1][0]))


def _run(
    argv: Sequence[str],
    here: Path,
    first: Callable[[], object],
    call: Callable[[], int] | None,
    outputs: list[int | str],
) -> None:
    """In the child; never returns. The exit code of an exception that nobody caught is Python's,
    1."""
    code = 1
    try:
        from quadsim.cli.cli import main

        # as a member of a pool it could start no workers
        mp.current_process()._config["daemon"] = False
        os.setsid()
        os.chdir(here)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        for stream, out in enumerate(outputs, 1):
            os.dup2(os.open(out, os.O_WRONLY | os.O_CREAT) if isinstance(out, str) else out, stream)
        sys.stdin, sys.stdout, sys.stderr = (
            open(i, "r" if i == 0 else "w", closefd=False)  # noqa: SIM115
            for i in range(3)
        )
        sys.argv = ["race", *argv]
        first()
        code = call() if call else main()  # main() ends by SystemExit
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(Exception):
                stream.flush()
        os._exit(code)
