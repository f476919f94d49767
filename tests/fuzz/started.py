"""`race` in a process forked from one that has loaded everything: no command waits for imports."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Started:
    """A command on its way, in a process group of its own."""

    pid: int
    folder: Path  # of what it writes to stdout and stderr

    def finish(self) -> tuple[int, str, str]:
        """Exit code, stdout, stderr."""
        _, status = os.waitpid(self.pid, 0)
        return os.waitstatus_to_exitcode(status), *((self.folder / name).read_text() for name in ("out", "err"))

    def kill(self) -> None:
        """SIGKILL to it alone, not to its workers."""
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)

    def gone(self, patience: float) -> bool:
        """Whether its workers end too [s]; else they are killed."""
        until = time.monotonic() + patience
        while time.monotonic() < until:
            try:
                os.killpg(self.pid, 0)
            except ProcessLookupError:
                return True
            time.sleep(0.02)
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        return False


def start(argv: Sequence[str], here: Path, first: Callable[[], object] | None = None) -> Started:
    """`race` with these words in this folder; `first` is called in its process."""
    said = Path(tempfile.mkdtemp(prefix="quadsim-said-"))
    sys.stdout.flush()
    pid = os.fork()
    if pid:
        with suppress(PermissionError):
            os.setpgid(pid, pid)
        return Started(pid, said)
    code = 1
    try:
        os.setpgid(0, 0)
        os.chdir(here)
        for number, name in enumerate(("out", "err"), 1):
            os.dup2(os.open(said / name, os.O_WRONLY | os.O_CREAT), number)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        sys.stdout, sys.stderr = (open(i, "w", closefd=False) for i in (1, 2))  # noqa: SIM115
        sys.argv = ["race", *argv]
        if first:
            first()
        from quadsim.app.cli import main

        main()
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(Exception):
                stream.flush()
        os._exit(code)
