"""read_logs(): the flights of log files, whatever kinds of files they are.

What a file is shows in its content, and its suffix plays no part.

| kind | read with |
|---|---|
| folder of a run of quadsim | |
| a run of quadsim as MCAP | extra `mcap` |
| Betaflight's blackbox log | orangebox, extra `logs` |
| PX4's log | pyulog, extra `logs` |
| log of the Crazyflie's SD card deck | |
| CSV | a mapping, see quadsim.logs.mapping |
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from quadsim.logs.blackbox import is_blackbox_log, read_blackbox_log
from quadsim.logs.cleaning import cleaned
from quadsim.logs.crazyflie import is_crazyflie_log, read_crazyflie_log
from quadsim.logs.csv_log import is_text, read_csv_log
from quadsim.logs.flight_log import FlightLog
from quadsim.logs.raw_log import LogError, RawLog
from quadsim.logs.run_log import RUN, is_mcap, read_mcap_log, read_run_log
from quadsim.logs.ulog import is_ulog, read_ulog

# Beginning of a file by which its kind is known [bytes]
HEAD = 4096
LFS_POINTER = b"version https://git-lfs"


class LogKind(NamedTuple):
    """A kind of log files."""

    name: str
    # whether a file with these first bytes is of this kind
    recognises: Callable[[bytes], bool]
    read: Callable[[Path], list[RawLog]]


KINDS = (
    LogKind("a run as MCAP", is_mcap, read_mcap_log),
    LogKind("PX4's .ulg", is_ulog, read_ulog),
    LogKind("Betaflight's blackbox", is_blackbox_log, read_blackbox_log),
    LogKind("the Crazyflie's SD card log", is_crazyflie_log, read_crazyflie_log),
    LogKind("CSV", is_text, read_csv_log),
)


def read_logs(path: str | Path, mapping: str | Path | None = None) -> list[FlightLog]:
    """Return the flights of a log, see quadsim.read_logs.

    Args:
        path: a file, or the folder of a stored run.
        mapping: of a CSV file: a mapping by name or path; None: the shipped one that fits.

    Raises:
        LogError: the log cannot be used; one line. Flights of a file that has others that can be
            used are left out, which their remarks say.
        FileError: the mapping cannot be read.
        ModuleNotFoundError: a package that reads this kind of log is not installed; one line.
    """
    path = Path(path)
    raw = _read(path, mapping)
    found = []
    problems = []
    for one in raw:
        try:
            found.append(cleaned(one))
        except LogError as error:
            problems.append(error)
    if not found:
        raise problems[0]
    return found


def _read(path: Path, mapping: str | Path | None) -> list[RawLog]:
    """Return the flights of a log as they were recorded. Raises as `read_logs`."""
    if path.is_dir():
        if not (path / RUN).exists():
            raise LogError(f"{path}: expected a log or the folder of a run, got another folder")
        return read_run_log(path)
    try:
        if not path.is_file():
            found = "a pipe or a device" if path.exists() else "no such file"
            raise LogError(f"{path}: expected a log, got {found}")
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise LogError(f"{path}: {(error.strerror or str(error)).lower()}") from None
    if not head:
        raise LogError(f"{path}: expected a log, got an empty file")
    if head.startswith(LFS_POINTER):
        raise LogError(f"{path}: expected a log, got a pointer of Git LFS: run git lfs pull")
    kind = next((kind for kind in KINDS if kind.recognises(head)), None)
    if kind is None:
        known = ", ".join(kind.name for kind in KINDS)
        raise LogError(f"{path}: expected a folder of a run or a file of one of these: {known}")
    if kind.read is read_csv_log:
        return read_csv_log(path, mapping)
    if mapping is not None:
        raise LogError(f"{path}: expected no mapping beside a log that names its signals itself")
    return kind.read(path)
