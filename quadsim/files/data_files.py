"""Find YAML files of courses, vehicles, presets and the like by name or by path."""

from __future__ import annotations

import os
from pathlib import Path

from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_errors import did_you_mean, shown

SUFFIXES = (".yaml", ".yml")
SIZE_MAX = 1_000_000  # [bytes]; a course of a thousand gates has about 60 000


def names(folder: Path) -> tuple[str, ...]:
    """Return the stems of the folder's YAML files, sorted."""
    return tuple(_files(folder))


def locate(name_or_path: str | Path, folder: Path, kind: str, listed: bool = True) -> Path:
    """Return the path of a file that is given by its name in a folder or by its path.

    Args:
        name_or_path: a path if it has a separator or a YAML suffix, else the name of a file in the
            folder.
        folder: the folder of the named files.
        kind: the kind of file for error messages, such as "course".
        listed: whether `race <kind>s` lists the names; otherwise the error lists them.

    Raises:
        FileError: the folder has no file of this name.
    """
    given = str(name_or_path)
    if given.endswith(SUFFIXES) or "/" in given or os.sep in given:
        return Path(given)
    known = _files(folder)
    if given in known:
        return known[given]
    near = did_you_mean(given, known)
    if not listed:
        raise FileError(f"no {kind} {shown(given)}: {near}, or a FILE.yaml")
    # a long list of all names is left to `race <kind>s`
    near = f": {near}" if near.startswith("did") else ""
    raise FileError(f"no {kind} {shown(given)}{near} (race {kind}s lists them)")


def _files(folder: Path) -> dict[str, Path]:
    return {path.stem: path for path in sorted(folder.iterdir()) if path.suffix in SUFFIXES}


def read_text(path: Path) -> str:
    """Return the text of a file.

    Raises:
        FileError: the file is missing, unreadable, too large, not UTF-8 or a folder.
    """
    try:
        # nothing may ever be written to a pipe; a shell's <(command) is one in /dev/fd
        if path.is_fifo() and path.parts[:2] != ("/", "dev"):
            raise FileError(f"{path}: expected a YAML file, got a pipe")
        with path.open("rb") as file:
            data = file.read(SIZE_MAX + 1)
    except FileNotFoundError:
        raise FileError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise FileError(f"{path}: expected a YAML file, got a folder") from None
    except OSError as error:
        raise FileError(f"{path}: {(error.strerror or str(error)).lower()}") from None
    if len(data) > SIZE_MAX:
        raise FileError(f"{path}: expected at most {SIZE_MAX} bytes, got more")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode()
        line = before.count("\n") + 1
        column = len(before) - before.rfind("\n")
        byte = data[error.start]
        problem = f"expected UTF-8, got byte 0x{byte:02x}"
        raise FileError(f"{path}:{line}:{column}: {problem}") from None
