"""Files by name or path: courses, vehicles and presets are folders of YAML, found and read in one
way."""

from __future__ import annotations

import os
from pathlib import Path

from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_words import did_you_mean, shown

SUFFIXES = (".yaml", ".yml")
SIZE_MAX = 1_000_000  # [bytes]; a course of a thousand gates has about 60 000


def names(folder: Path) -> tuple[str, ...]:
    """Stems of the folder's YAML files, sorted."""
    return tuple(_files(folder))


def locate(name_or_path: str | Path, folder: Path, kind: str, listed: bool = True) -> Path:
    """A bare name is looked up in the folder; anything with a separator or a YAML suffix is a path
    as it stands.

    Raises FileError for an unknown name. kind: what it is, "course"; listed: whether there is a
    `race <kind>s`, else the error names all that are known.
    """
    given = str(name_or_path)
    if given.endswith(SUFFIXES) or "/" in given or os.sep in given:
        return Path(given)
    known = _files(folder)
    if given not in known:
        near = did_you_mean(given, known)
        if not listed:
            raise FileError(f"no {kind} {shown(given)}: {near}, or a FILE.yaml")
        # what else is known may be of another system
        near = f": {near}" if near.startswith("did") else ""
        raise FileError(f"no {kind} {shown(given)}{near} (race {kind}s lists them)")
    return known[given]


def _files(folder: Path) -> dict[str, Path]:
    return {path.stem: path for path in sorted(folder.iterdir()) if path.suffix in SUFFIXES}


def read_text(path: Path) -> str:
    """The file's text. Raises FileError: missing, a folder, unreadable, too large, not UTF-8."""
    try:
        # nobody may ever write; <(command) is one in /dev/fd
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
        line, column = before.count("\n") + 1, len(before) - before.rfind("\n")
        raise FileError(
            f"{path}:{line}:{column}: expected UTF-8, got byte 0x{data[error.start]:02x}"
        ) from None
