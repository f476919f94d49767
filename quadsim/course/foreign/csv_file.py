"""Tables of gates: a header, then a row for each gate in the order of flight.

    x, y, z                                      position
    yaw_deg, yaw_rad, or yaw with --angles       direction of the passage, likewise pitch and roll
    qw, qx, qy, qz                               in place of angles: the passage is the x axis
    width, height, or opening                    sizes of the opening, if --opening is not given
    name                                         of the gate

The separator is a comma, a semicolon or a tab. Lines that begin with # are left out. With --frame
ned the yaw is the heading: 0 is north, 90 is east.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from math import radians
from typing import Any

import numpy as np

from quadsim.course.foreign.reading import Entry, file_error, in_order
from quadsim.course.foreign.track import ForeignGate, ForeignTrack, Reading
from quadsim.files.strict_yaml import FileError
from quadsim.files.yaml_errors import cut, shown
from quadsim.rotation import Vec3, euler_matrix

POSITION = ("x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")
ANGLES = ("yaw", "pitch", "roll")
SIZES = ("width", "height", "opening")
OF_ANGLES = tuple(f"{name}{end}" for name in ANGLES for end in ("", "_deg", "_rad"))
KNOWN = {*POSITION, *QUATERNION, *OF_ANGLES, *SIZES, "name"}


def read_csv(text: str, file: str, reading: Reading) -> ForeignTrack:
    """Return the track that a table describes. Raises FileError."""
    rows = list(_rows(text, file))
    if not rows:
        raise FileError(f"{file}: expected a header and a row for each gate, got no row")
    # the columns of the header are the keys of each row
    columns = list(rows[0].value)
    names = [str(row.value.get("name") or k) for k, row in enumerate(rows, 1)]
    # Rows stand in the order of flight, whatever names they have.
    order = [(k, False) for k in range(len(rows))]
    if reading.gates:
        order = in_order(names, reading.gates, rows[0].fail)
    gates = []
    for k, reverse in order:
        row = rows[k]
        x, y, z = (row.at(name).number() for name in POSITION)
        axes = _axes(row, reading)
        gates.append(ForeignGate(names[k], row.key, (x, y, z), axes, _sizes(row), reverse))
    left_out = [shown(name) for name in columns if name not in KNOWN]
    notes = [cut(f"columns left out: {', '.join(left_out)}")] if left_out else []
    return ForeignTrack(tuple(gates), "enu", "x", "a table", notes=notes)


def _rows(text: str, file: str) -> Iterator[Entry]:
    """Yield the rows as mappings from columns to numbers or texts. Raises FileError."""
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        return
    first, head = lines[0]
    separator = max(",;\t", key=head.count)
    columns = [name.strip().lower() for name in _cells(head, separator, file, first)]
    missing = [name for name in POSITION if name not in columns]
    if missing:
        got = cut(", ".join(columns))
        wanted = f"a header with x, y, z and a direction, such as x,y,z,yaw_deg; got {got!r}"
        raise FileError(f"{file}:{first}: expected {wanted}")
    twice = next((name for name in columns if columns.count(name) > 1), None)
    if twice is not None:
        raise FileError(f"{file}:{first}: expected each column once, got {shown(twice)} twice")
    for number, line in lines[1:]:
        cells = _cells(line, separator, file, number)
        if len(cells) != len(columns):
            wanted = f"expected {len(columns)} cells, as the header has"
            raise FileError(f"{file}:{number}: {wanted}, got {len(cells)}")
        row = {name: _value(cell.strip()) for name, cell in zip(columns, cells, strict=True)}
        yield _entry(row, file, number)


def _entry(row: Mapping[str, Any], file: str, line: int) -> Entry:
    def fail(key: str, problem: str) -> FileError:
        return file_error(f"{file}:{line}", key, problem)

    return Entry(dict(row), "", fail)


def _cells(line: str, separator: str, file: str, number: int) -> list[str]:
    """Return the cells of a line. Raises FileError."""
    try:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    except csv.Error as error:
        raise FileError(f"{file}:{number}: not CSV: {error}") from None


def _value(cell: str) -> float | str | None:
    """Return the value of a cell: a number, a text, or None if the cell is empty."""
    try:
        return float(cell)
    except ValueError:
        return cell or None


def _axes(row: Entry, reading: Reading) -> np.ndarray:
    """Return the axes of a gate as columns.  (3, 3)"""
    if row.get("qw") is not None:
        numbers = [row.at(name).number() for name in QUATERNION]
        return Entry(numbers, "qw, qx, qy, qz", row.fail).axes()
    yaw = _angle(row, "yaw", reading)
    if yaw is None:
        raise row.error("expected a direction: yaw_deg, yaw_rad, or qw, qx, qy, qz; got none")
    return euler_matrix(
        yaw, _angle(row, "pitch", reading) or 0.0, _angle(row, "roll", reading) or 0.0
    )


def _angle(row: Entry, name: str, reading: Reading) -> float | None:
    """Return an angle [rad], None if the table does not have it. Raises FileError."""
    in_radians = row.get(f"{name}_rad")
    if in_radians:
        return in_radians.number()
    in_degrees = row.get(f"{name}_deg")
    if in_degrees:
        return radians(in_degrees.number())
    given = row.get(name)
    if given is None:
        return None
    if reading.angles is None:
        wanted = f"expected the column {name}_deg or {name}_rad, or --angles deg or rad"
        raise given.error(f"{wanted}, got a column without a unit")
    return radians(given.number()) if reading.angles == "deg" else given.number()


def _sizes(row: Entry) -> Vec3 | None:
    """Return the sizes of the opening, None if the row has none. Raises FileError."""
    opening = row.get("opening")
    if opening:
        side = opening.size()
        return side, side, side
    if row.get("width") is None and row.get("height") is None:
        return None
    width = row.at("width").size()
    return width, width, row.at("height").size()
