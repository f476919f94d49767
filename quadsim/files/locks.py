"""Lock folders; a lock ends with its process, even if the process is killed."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def lock_folder(folder: Path) -> int:
    """Return a handle that holds the folder's lock until it is closed.

    Raises:
        BlockingIOError: another process has the lock.
        OSError: the folder does not exist, or the file system has no locks.
    """
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # It may have been removed before it was locked
        os.stat(folder)
    except BaseException:
        os.close(handle)
        raise
    return handle


@contextmanager
def in_turn(folder: Path) -> Iterator[None]:
    """Let only one process at a time run the body of the context; others wait.

    On a file system without locks no process waits.

    Raises:
        OSError: the folder does not exist.
    """
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
