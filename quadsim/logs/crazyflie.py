"""Logs of the Crazyflie's micro SD card deck.

The format is that of Bitcraze's decoder, tools/usdlog/cfusdlog.py of the firmware (MIT): the byte
0xBC, a version, the kinds of events with names and types of their variables, then events, each with
its kind and its time, and a checksum at the end. Numbers are little-endian. Version 1 has times in
milliseconds, version 2 in microseconds.

The firmware names its variables; `mappings/crazyflie.yaml` says which signals they are.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import NamedTuple

import numpy as np

from quadsim.files.arrays import read_bytes
from quadsim.logs.mapping import mapped, shipped_mapping
from quadsim.logs.raw_log import MOST_ROWS, LogError, RawLog, cut_remark

MAGIC = 0xBC
# The event that has a row at each tick; its number is the largest of 16 bits
AT_EACH_TICK = "fixedFrequency"
# Type of the time and seconds in its unit, by version
TIMES = {1: ("<u4", 1e-3), 2: ("<u8", 1e-6)}
CHECKSUM = 4  # [bytes]
VARIABLE = re.compile(r".+\(.\)")  # with its type


class EventKind(NamedTuple):
    """A kind of events."""

    number: int
    name: str
    # of one event, with its number and its time
    row: np.dtype


def is_crazyflie_log(head: bytes) -> bool:
    """Return whether a file with these first bytes is a log of the deck."""
    return len(head) > 4 and head[0] == MAGIC and head[1] in TIMES and head[2] == 0


def read_crazyflie_log(path: Path) -> list[RawLog]:
    """Return the flight of a log of the deck.

    Raises:
        LogError: the file is damaged, or has no rows of a fixed frequency.
    """
    data = read_bytes(path, "a log of the Crazyflie's SD card")
    version = data[1]
    _, second = TIMES[version]
    try:
        kinds, first = _kinds(data, version)
    except (struct.error, IndexError, ValueError, TypeError) as error:
        raise LogError(f"{path}: its header is cut off or damaged: {error}") from None
    rows, remarks = _rows(data, first, kinds, path)
    columns = {name: rows[name] for name in rows.dtype.names or ()}
    columns["t"] = columns.pop("#time") * second
    mapping = shipped_mapping("crazyflie")
    return [mapped(columns, mapping, path.name, remarks)]


def _kinds(data: bytes, version: int) -> tuple[dict[int, EventKind], int]:
    """Return the kinds of events by number, and the place of the first event."""
    kinds = {}
    (count,) = struct.unpack_from("<H", data, 3)
    place = 5
    for _ in range(count):
        (number,) = struct.unpack_from("<H", data, place)
        name, place = _text(data, place + 2)
        (variables,) = struct.unpack_from("<H", data, place)
        place += 2
        fields = [("#kind", "<u2"), ("#time", TIMES[version][0])]
        for _ in range(variables):
            # A variable is written as its name and its type, such as acc.x(f).
            written, place = _text(data, place)
            if not VARIABLE.fullmatch(written):
                raise ValueError(f"expected a variable like acc.x(f), got {written[:20]!r}")
            fields.append((written[:-3], np.dtype(written[-2]).newbyteorder("<").str))
        kinds[number] = EventKind(number, name, np.dtype(fields))
    return kinds, place


def _text(data: bytes, place: int) -> tuple[str, int]:
    """Return the text at a place, which ends with a zero, and the place behind it."""
    end = data.index(0, place)
    return data[place:end].decode(), end + 1


def _rows(
    data: bytes, first: int, kinds: dict[int, EventKind], path: Path
) -> tuple[np.ndarray, list[str]]:
    """Return the rows at each tick, and remarks. Raises LogError."""
    ticks = next((kind for kind in kinds.values() if kind.name == AT_EACH_TICK), None)
    if ticks is None:
        known = ", ".join(kind.name for kind in kinds.values()) or "none"
        raise LogError(f"{path}: expected events {AT_EACH_TICK}, got {known}")
    end = len(data) - CHECKSUM
    if len(kinds) == 1:
        found = np.frombuffer(data, ticks.row, max(end - first, 0) // ticks.row.itemsize, first)
    else:
        found = _of_several_kinds(data, first, end, kinds, ticks)
    good = found["#kind"] == ticks.number
    remarks = []
    if not good.all():
        # An event of unknown length: the next event cannot be found
        found = found[: int(np.argmin(good))]
        remarks.append("the log is damaged: what follows the damage is left out")
    if len(found) > MOST_ROWS:
        remarks.append(cut_remark(len(found)))
        found = found[:MOST_ROWS]
    if not len(found):
        raise LogError(f"{path}: expected readings, got a header alone")
    return found, remarks


def _of_several_kinds(
    data: bytes, first: int, end: int, kinds: dict[int, EventKind], ticks: EventKind
) -> np.ndarray:
    """Return the rows at each tick of a log that has events of other kinds among them."""
    places = []
    place = first
    while place + 2 <= end and len(places) <= MOST_ROWS:
        kind = kinds.get(int.from_bytes(data[place : place + 2], "little"))
        if kind is None or place + kind.row.itemsize > end:
            break
        if kind is ticks:
            places.append(place)
        place += kind.row.itemsize
    rows = [data[start : start + ticks.row.itemsize] for start in places]
    return np.frombuffer(b"".join(rows), ticks.row)
