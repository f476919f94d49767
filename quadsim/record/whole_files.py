"""Write files completely or not at all, and check paths before anything is written."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4

from quadsim.files.atomic import replace_file
from quadsim.record.run import RunError

# [bytes] that a folder has to have room for
PROBE = 4096


def write_whole(path: Path, data: bytes) -> None:
    """Write a file completely or not at all, see replace_file; make a missing folder.

    Raises:
        RunError: the file cannot be written.
    """
    expect_file(path)
    with file_errors(path, "cannot write"):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, data)


def expect_file(path: Path) -> None:
    """Raise RunError unless this path is a file, or a file can be written there."""
    with file_errors(path, "cannot use"):
        if path.name and (not path.exists() or path.is_file()):
            return
    found = "a folder" if path.is_dir() else "a pipe or a device"
    raise RunError(f"{str(path)!r}: expected the name of a file, got {found}")


def expect_new_file(path: Path) -> None:
    """Raise RunError if this path exists already, so that nothing is overwritten."""
    expect_file(path)
    if path.exists():
        wanted = "expected the name of a new file"
        raise RunError(f"{str(path)!r}: {wanted}, got one that exists: name another, or remove it")


def expect_writable(folder: Path) -> None:
    """Raise RunError if a folder, or the parent of a missing folder, cannot be written."""
    above = [place for place in (folder, *folder.parents, Path()) if place.exists()]
    nearest = above[0]
    if not nearest.is_dir():
        raise RunError(f"{folder}: cannot write here: {nearest} is not a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise RunError(f"{folder}: cannot write here: no permission to write in {nearest}")


def try_writing(folder: Path) -> None:
    """Check that a folder can be written, before a long search, by writing a file and removing it.

    A missing folder is made, and remains only if something is written there later.

    Raises:
        RunError: the folder cannot be made, or a file cannot be written there.
    """
    expect_writable(folder)
    probe = folder / f".{uuid4().hex}.tmp"
    made: list[Path] = []
    try:
        with file_errors(folder, "cannot write here"):
            made = [place for place in (folder, *folder.parents) if not place.exists()]
            folder.mkdir(parents=True, exist_ok=True)
            replace_file(probe, bytes(PROBE))
    finally:
        with suppress(OSError):
            probe.unlink()
        # the innermost first; one that somebody else has used meanwhile stays
        for place in made:
            with suppress(OSError):
                place.rmdir()


@contextmanager
def file_errors(path: str | Path, problem: str) -> Iterator[None]:
    """Convert an OSError in this context to a RunError that names the path and the problem."""
    try:
        yield
    except OSError as error:
        raise RunError(f"{path}: {problem}: {error.strerror or error}") from error
