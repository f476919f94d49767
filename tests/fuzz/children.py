"""Commands in processes that are forked from one in which everything is loaded.

So no command waits for imports.
"""

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

# [bytes] that a command may print before anyone reads.
PIPE = 1 << 20


def at_once() -> None:
    """Do nothing before the command."""


@dataclass(frozen=True)
class Child:
    """A running command in a session of its own, and the pipes behind its stdout and stderr."""

    pid: int
    reads: tuple[int, int]

    def finish(self) -> tuple[int, str, str]:
        """Wait for the command. Return its exit code, stdout and stderr."""
        _, status = os.waitpid(self.pid, 0)
        # Workers that outlive it would hold its streams.
        self.kill_all()
        out, err = self.texts()
        return os.waitstatus_to_exitcode(status), out, err

    def kill(self, patience: float) -> bool:
        """Kill the command alone, then its workers if they do not end.

        Args:
            patience: time in which the workers have to end [s], longer on a busy machine.

        Returns:
            Whether the workers have ended by themselves.
        """
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        ended = self._workers_end(patience)
        self.kill_all()
        for read in self.reads:
            os.close(read)
        return ended

    def _workers_end(self, patience: float) -> bool:
        until = time.monotonic() + patience * waiting()
        while time.monotonic() < until:
            try:
                os.killpg(self.pid, 0)
            except ProcessLookupError:
                return True
            time.sleep(0.02)
        return False

    def kill_all(self) -> None:
        """Kill the command and its workers."""
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)

    def texts(self) -> tuple[str, str]:
        """Return stdout and stderr, to their ends."""
        out, err = (_text(read) for read in self.reads)
        return out, err


def _text(read: int) -> str:
    with open(read, "rb") as pipe:
        return pipe.read().decode(errors="replace")


def waiting() -> float:
    """Return how many programs want each processor; at least 1."""
    return max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


def start(
    argv: Sequence[str],
    here: Path,
    *,
    first: Callable[[], object] = at_once,
    call: Callable[[], int] | None = None,
    to: str | None = None,
) -> Child:
    """Start `race`, or a function, in a child of this process.

    Args:
        argv: the arguments of `race`.
        here: the folder in which it runs.
        first: is called in the child before the command.
        call: a function in place of the command; it returns the exit code.
        to: the file that stdout is; default: a pipe.
    """
    out_read, out_write = os.pipe()
    err_read, err_write = os.pipe()
    # The child would print the buffered text too.
    sys.stdout.flush()
    sys.stderr.flush()
    pid = os.fork()
    if not pid:
        _run(argv, here, first, call, outputs=(to or out_write, err_write))
    for write in (out_write, err_write):
        os.close(write)
    for read in (out_read, err_read):
        fcntl.fcntl(read, fcntl.F_SETPIPE_SZ, PIPE)
    return Child(pid, (out_read, err_read))


def _run(
    argv: Sequence[str],
    here: Path,
    first: Callable[[], object],
    call: Callable[[], int] | None,
    outputs: tuple[int | str, int],
) -> None:
    """Run the command in the child; never return.

    The exit code of an exception that nobody has caught is 1, as Python's is.
    """
    code = 1
    try:
        from quadsim.cli.cli import main

        # A member of a pool could start no workers.
        mp.current_process()._config["daemon"] = False
        os.setsid()
        os.chdir(here)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        _redirect(outputs)
        sys.argv = ["race", *argv]
        first()
        # main() ends by SystemExit.
        code = call() if call else main()
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(Exception):
                stream.flush()
        os._exit(code)


def _redirect(outputs: tuple[int | str, int]) -> None:
    """Read stdin from /dev/null, and write stdout and stderr to files or pipes."""
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for stream, out in enumerate(outputs, 1):
        target = os.open(out, os.O_WRONLY | os.O_CREAT) if isinstance(out, str) else out
        os.dup2(target, stream)
    sys.stdin = os.fdopen(0, "r", closefd=False)
    sys.stdout = os.fdopen(1, "w", closefd=False)
    sys.stderr = os.fdopen(2, "w", closefd=False)
