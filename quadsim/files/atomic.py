"""Write files completely or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import BinaryIO
from uuid import uuid4


def replace_file(path: Path, data: bytes) -> None:
    """Write a file completely or not at all, and flush it to the disk.

    Several processes may write the same file at once. A folder, a pipe or a device is refused,
    because root could otherwise replace /dev/null itself.

    Raises:
        OSError: the file cannot be written, or the path exists and is not a regular file.
    """
    if path.exists() and not path.is_file():
        problem = "expected a file or a new name, found a folder, a pipe or a device"
        raise OSError(errno.EINVAL, problem)
    temporary = path.with_name(f"{path.name[:40]}.{uuid4().hex}.tmp")
    try:
        with unnamed_file(path.parent) or temporary.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
            if not temporary.exists():
                # give the unnamed file a name, now that it is whole
                descriptor = f"/proc/self/fd/{file.fileno()}"
                os.link(descriptor, temporary, src_dir_fd=0, follow_symlinks=True)
        temporary.replace(path)
    # Ctrl-C too leaves no temporary file
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def unnamed_file(folder: Path) -> BinaryIO | None:
    """Open a new file without a name, which vanishes when its writer is killed.

    Returns:
        The file; None if the system does not support such files.
    """
    try:
        return os.fdopen(os.open(folder, os.O_TMPFILE | os.O_WRONLY, 0o666), "wb")
    except (OSError, AttributeError):
        return None
