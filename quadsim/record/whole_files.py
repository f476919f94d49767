"""Files that are there whole or not at all, and what is said of a path before anything is
written."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4

from quadsim.files.atomic import replace_file, unnamed_file
from quadsim.record.run import RunError


def write_whole(path: Path, data: bytes) -> None:
    """See replace_file; its folder is made where it is missing. Raises RunError."""
    expect_file(path)
    with one_line(path, "cannot write"):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, data)


def expect_file(path: Path) -> None:
    """Raises RunError unless a file may be written, or is, at this path."""
    with one_line(path, "cannot use"):
        if path.name and (not path.exists() or path.is_file()):
            return
    found = "a folder" if path.is_dir() else "a pipe or a device"
    raise RunError(f"{str(path)!r}: expected the name of a file, got {found}")


def expect_writable(folder: Path) -> None:
    """Raises RunError where nothing can be written into the folder, or where it cannot be made."""
    there = next(f for f in (folder, *folder.parents, Path()) if f.exists())
    with one_line(folder, "cannot write here"):
        probe = there / f"{uuid4().hex}.tmp"
        with unnamed_file(there) or probe.open("xb"):
            probe.unlink(missing_ok=True)


def sync(folder: Path) -> None:
    """Put a folder's own entries on the disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextmanager
def one_line(path: str | Path, what: str) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise RunError(f"{path}: {what}: {error.strerror or error}") from error
