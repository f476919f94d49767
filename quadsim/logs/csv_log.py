"""Logs as CSV. A mapping gives the meaning of their columns.

The separator is a comma, a semicolon or a tab. The first line, below comments that begin with #,
names the columns. An empty cell and one that is not a number are missing readings.
"""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterator, Sequence
from itertools import count, islice
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
SEPARATORS = ",;\t"
# In a text in columns, one of this many first lines has a separator.
FIRST_LINES = 5


def is_text(head: bytes) -> bool:
    """Return whether a file with these first bytes is a text in columns.

    A line above the names, which is no comment, is found when the names are read.
    """
    lines = [line.decode(errors="replace") for line in head.splitlines()]
    first = [line for line in lines if not _is_comment(line)][:FIRST_LINES]
    return b"\0" not in head and any(_has_separator(line) for line in first)


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
        line, first = _first_line(file, path)
        separator = max(SEPARATORS, key=lambda each: len(_cells(first, each)))
        header = [name.strip().removeprefix("#").strip() for name in _cells(first, separator)]
        used = _mapping_of(header, mapping, f"{path}:{line}")
        wanted = used.column_names()
        places = [place for place, name in enumerate(header) if name in wanted]
        _expect_once(header, wanted, f"{path}:{line}")
        blocks = []
        bad_lines = 0
        rows = 0
        is_cut = False
        for lines in _lines(file):
            if lines and not rows:
                _expect_as_wide(lines[0], header, separator, f"{path}:{line}")
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


def _first_line(file: IO[str], path: Path) -> tuple[int, str]:
    """Return the number and the text of the line that names the columns.

    Raises:
        LogError: it is longer than any line of names, or has no separator.
    """
    for number in count(1):
        line = file.readline(LONGEST_HEADER)
        if len(line) == LONGEST_HEADER:
            wanted = f"expected a line of names of at most {LONGEST_HEADER} characters"
            raise LogError(f"{path}:{number}: {wanted}, got a longer one")
        if line and _is_comment(line):
            continue
        names = line.rstrip("\r\n")
        if not _has_separator(names):
            wanted = "expected the names of the columns"
            raise LogError(
                f"{path}:{number}: {wanted}, got {cut(repr(names))}: begin a comment with #"
            )
        return number, names
    raise AssertionError


def _is_comment(line: str) -> bool:
    """Return whether a line is empty or a comment.

    A line that begins with "#" and contains separators is the header, not a comment.
    """
    text = line.strip()
    return not text or (text.startswith("#") and not _has_separator(text))


def _has_separator(line: str) -> bool:
    return any(each in line for each in SEPARATORS)


def _cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, of which those in quotes may have separators."""
    return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])


def _expect_once(header: Sequence[str], wanted: Collection[str], place: str) -> None:
    """Raise LogError if a column that is read is there twice."""
    for name in wanted:
        if header.count(name) > 1:
            got = f"got it {header.count(name)} times"
            raise LogError(f"{place}: expected one column {name!r}, {got}: rename or remove one")


def _expect_as_wide(line: str, header: Sequence[str], separator: str, place: str) -> None:
    """Raise LogError unless the first row has a cell for each name.

    A separator at the end of a line, and the empty cell behind it, say nothing.
    """
    cells = _cells(line, separator)
    named = len(header) - (header[-1] == "")
    given = len(cells) - (cells[-1].strip() == "" and len(cells) > named)
    if given != named:
        wanted = f"expected a row of {named} cells, as many as there are names"
        advice = f"put names that contain {separator!r} into quotes"
        raise LogError(f"{place}: {wanted}, got {given}: {advice}")


def _mapping_of(header: Sequence[str], given: str | Path | None, place: str) -> LogMapping:
    """Return the mapping of a file whose names are at a place. Raises LogError, FileError."""
    if any(_is_number(name) for name in header if name):
        wanted = "expected a first line that names the columns"
        raise LogError(f"{place}: {wanted}, got {cut(', '.join(header))!r}")
    if given is not None:
        found = load_mapping(given)
        if not set(found.time.names) <= set(header):
            names = cut(", ".join(header))
            wanted = f"expected the column {found.time.names[0]!r} of {given} for the time"
            raise LogError(f"{place}: {wanted}, got {names}")
        return found
    found = fitting_mapping(header)
    if found is None:
        known = ", ".join(shipped_mappings())
        wanted = f"expected the columns of a shipped mapping ({known}) or --mapping FILE.yaml"
        raise LogError(f"{place}: {wanted}, got the columns {cut(', '.join(header))}")
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
    """Return the result of `_numbers` for lines in which some cells are not numbers."""
    found = np.full((len(lines), len(places)), nan)
    bad = 0
    for k, line in enumerate(lines):
        cells = _cells(line, separator)
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
