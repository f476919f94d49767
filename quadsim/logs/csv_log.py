"""Logs as CSV. A mapping gives the meaning of their columns.

The separator is a comma, a semicolon or a tab. The first line names the columns. An empty cell and
one that is not a number are missing readings.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from itertools import islice
from math import nan
from pathlib import Path
from typing import IO

import numpy as np

from quadsim.files.yaml_errors import cut
from quadsim.logs.mapping import (
    LogMapping,
    fitting_mapping,
    load_mapping,
    mapped,
    shipped_mappings,
)
from quadsim.logs.raw_log import MOST_ROWS, LogError, RawLog

# Lines that are read at once
LINES = 20_000
# Longest line of names [characters]
LONGEST_HEADER = 100_000


def is_text(head: bytes) -> bool:
    """Return whether a file that begins so is a text in columns."""
    line, _, _ = head.partition(b"\n")
    return b"\0" not in head and any(separator in line for separator in (b",", b";", b"\t"))


def read_csv_log(path: Path, mapping: str | Path | None = None) -> list[RawLog]:
    """Return the flight of a CSV file.

    Args:
        path: the file.
        mapping: a mapping by name or path; None: the shipped one whose columns the file has.

    Raises:
        LogError: the file is no table of numbers, or no mapping fits it.
        FileError: the mapping cannot be read.
    """
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as file:
        first = file.readline(LONGEST_HEADER)
        separator = max(",;\t", key=first.count)
        header = [name.strip().strip('"') for name in first.rstrip("\r\n").split(separator)]
        used = _mapping_of(header, mapping, path)
        wanted = used.column_names()
        places = [place for place, name in enumerate(header) if name in wanted]
        blocks = []
        bad_lines = 0
        rows = 0
        is_cut = False
        for lines in _lines(file):
            room = MOST_ROWS - rows
            block, bad = _numbers(lines[:room], separator, places)
            blocks.append(block)
            bad_lines += bad
            rows += len(block)
            is_cut = len(lines) > room
            if is_cut:
                break
    if not rows:
        raise LogError(f"{path}: expected a row for each reading, got the line of names alone")
    remarks = [f"the first {MOST_ROWS:,} rows are read, and no more"] if is_cut else []
    if bad_lines:
        remarks.append(f"lines with cells that are missing or no numbers: {bad_lines}")
    missing = used.missing(header)
    if missing:
        remarks.append(f"left out: {'; '.join(missing)}")
    columns = {header[place]: _joined(blocks, k) for k, place in enumerate(places)}
    return [mapped(columns, used, path.name, remarks)]


def _mapping_of(header: Sequence[str], given: str | Path | None, path: Path) -> LogMapping:
    """Return the mapping of a file. Raises LogError, FileError."""
    if any(_is_number(name) for name in header if name):
        wanted = "expected a first line that names the columns"
        raise LogError(f"{path}:1: {wanted}, got {cut(', '.join(header))!r}")
    if given is not None:
        found = load_mapping(given)
        if not set(found.time.names) <= set(header):
            names = cut(", ".join(header))
            wanted = f"expected the column {found.time.names[0]!r} of {given} for the time"
            raise LogError(f"{path}:1: {wanted}, got {names}")
        return found
    found = fitting_mapping(header)
    if found is None:
        known = ", ".join(shipped_mappings())
        wanted = f"expected the columns of a shipped mapping ({known}) or --mapping FILE.yaml"
        raise LogError(f"{path}:1: {wanted}, got the columns {cut(', '.join(header))}")
    return found


def _lines(file: IO[str]) -> Iterator[list[str]]:
    """Yield the lines of a file in lists, without empty ones."""
    while lines := list(islice(file, LINES)):
        yield [line for line in lines if line.strip()]


def _numbers(lines: Sequence[str], separator: str, places: Sequence[int]) -> tuple[np.ndarray, int]:
    """Return the numbers of lines, and how many lines have missing ones.  (lines, places)"""
    if not lines:
        return np.empty((0, len(places))), 0
    try:
        found = np.loadtxt(
            lines, delimiter=separator, usecols=places, ndmin=2, comments=None, quotechar='"'
        )
    except ValueError:
        return _numbers_one_by_one(lines, separator, places)
    return found, 0


def _numbers_one_by_one(
    lines: Sequence[str], separator: str, places: Sequence[int]
) -> tuple[np.ndarray, int]:
    """Return what `_numbers` does, of lines that have cells that are no numbers."""
    found = np.full((len(lines), len(places)), nan)
    bad = 0
    for k, line in enumerate(lines):
        cells = next(csv.reader([line], delimiter=separator), [])
        numbers = [_number(cells[place]) if place < len(cells) else None for place in places]
        found[k] = [nan if number is None else number for number in numbers]
        bad += None in numbers
    return found, bad


def _joined(blocks: Sequence[np.ndarray], column: int) -> np.ndarray:
    """Return one column of all blocks.  (n,)"""
    return np.concatenate([block[:, column] for block in blocks])


def _number(cell: str) -> float | None:
    """Return the number in a cell, None if the cell is not a number."""
    try:
        return float(cell)
    except ValueError:
        return None


def _is_number(cell: str) -> bool:
    return _number(cell) is not None
