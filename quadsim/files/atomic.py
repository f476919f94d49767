"""Files written whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4


def replace_file(path: Path, data: bytes) -> None:
    """Whole or not at all, and on the disk itself; several may write the same file at once. Raises
    OSError.

    What is there and is no file stays: a user with all rights would replace /dev/null itself.
    """
    if path.exists() and not path.is_file():
        raise OSError(
            errno.EINVAL, "expected a file or a new name, found a folder, a pipe or a device"
        )
    temporary = path.with_name(f"{path.name[:40]}.{uuid4().hex}.tmp")
    try:
        with unnamed_file(path.parent) or temporary.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            if not temporary.exists():
                os.link(
                    f"/proc/self/fd/{file.fileno()}", temporary, src_dir_fd=0, follow_symlinks=True
                )
        temporary.replace(path)
    except BaseException:  # Ctrl-C too
        temporary.unlink(missing_ok=True)
        raise


def unnamed_file(folder: Path) -> BinaryIO | None:
    """A new file that is gone when its writer is killed, until it gets a name; None where the
    system has none."""
    try:
        return os.fdopen(os.open(folder, os.O_TMPFILE | os.O_WRONLY, 0o666), "wb")
    except (OSError, AttributeError):
        return None
