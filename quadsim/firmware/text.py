"""The text of a configuration, from a pilot's file or as it comes with a vehicle."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from quadsim.files.strict_yaml import FileError
from quadsim.vehicle import VEHICLES, Vehicle

LARGEST = 200_000  # bytes of a configuration
NOT_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")
LINE_END = re.compile(r"\r\n|\r|\n")
SHIPPED = ".betaflight.txt"  # ends the name of the file that comes with a vehicle


class Text(NamedTuple):
    """The text of a configuration."""

    name: str  # of the file
    lines: tuple[str, ...]


def read_text(path: Path) -> Text:
    """Return the lines of a configuration's file: UTF-8, UTF-16 with its mark, or Latin-1.

    Raises FileError.
    """
    wanted = f"{path}: expected a text of Betaflight's CLI"
    try:
        # A pipe or a device may have no end.
        if path.exists() and not path.is_file():
            raise FileError(f"{wanted}, got a folder, a pipe or a device: save the text in a file")
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
    except OSError as error:
        raise FileError(f"{wanted}: {error.strerror}") from None
    except ValueError as error:  # a null character in the path
        if isinstance(error, FileError):
            raise
        raise FileError(f"{str(path)!r}: expected a text of Betaflight's CLI: {error}") from None
    if len(data) > LARGEST:
        raise FileError(f"{path}: expected at most {LARGEST} bytes, got more")
    text = _decoded(data)
    if text is None:
        raise FileError(f"{path}: expected a text in UTF-8, got other data")
    lines = LINE_END.split(text)
    return Text(str(path), tuple(lines[:-1] if lines[-1] == "" else lines))


def _decoded(data: bytes) -> str | None:
    """Return the text of a file, None if it is not text."""
    marked = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    for encoding in ("utf-16",) if marked else ("utf-8-sig", "latin-1"):
        # Every file could be Latin-1.
        if encoding == "latin-1" and NOT_TEXT.search(data):
            return None
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    return None


def shipped_configuration(vehicle: Vehicle) -> Text | None:
    """Return the firmware's configuration that comes with a vehicle, None if none does."""
    path = VEHICLES / f"{vehicle.name.partition('-twr')[0]}{SHIPPED}"
    return read_text(path) if path.exists() else None
