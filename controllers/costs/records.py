"""Rows of numbers that the compiled lanes read, by the names of a record's fields.

A table of rows is an array, one record a row, one field a column: the lanes read arrays. Where rows are made they are
records (NamedTuple), and where columns of a table are read they are found by the record's field names.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


def as_rows(records: Sequence[NamedTuple], record: type[NamedTuple]) -> np.ndarray:
    """Return a table of these records, also where there are none.  (records, fields)"""
    return np.array(records, float).reshape(-1, len(record._fields))


def column(rows: np.ndarray, record: type[NamedTuple], name: str) -> np.ndarray:
    """Return the column of a table in which this field of its records stands, a view.  (rows,)"""
    return rows[:, record._fields.index(name)]


def columns(rows: np.ndarray, record: type[NamedTuple], first: str, last: str) -> np.ndarray:
    """Return the columns from one field of a table's records to another, both included, a view.  (rows, columns)"""
    begin, end = record._fields.index(first), record._fields.index(last)
    return rows[:, begin : end + 1]
