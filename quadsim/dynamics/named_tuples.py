"""Records: NamedTuples of numbers, or of other records.

The fields of a record give every table its names and its order.

A table of rows is an array, one record a row, one number a column: the compiled lanes read arrays.
Where rows are made they are records, and where columns of a table are read they are found by the
record's field names.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, get_type_hints

import numpy as np


def is_record(kind: Any) -> bool:
    """Return whether this type is a NamedTuple."""
    return isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields")


def field_types(kind: type) -> dict[str, Any]:
    """Return the type of each field of a NamedTuple, in order; `float` where none is annotated."""
    hints = get_type_hints(kind)
    return {name: hints.get(name, float) for name in kind._fields}  # pyright: ignore[reportAttributeAccessIssue]


def units_of(kind: type) -> dict[str, str]:
    """Return the unit of each field of a NamedTuple of `Annotated[float, unit]`, in order."""
    hints = get_type_hints(kind, include_extras=True)
    return {name: hints[name].__metadata__[0] for name in kind._fields}  # pyright: ignore[reportAttributeAccessIssue]


def flat(value: Any) -> Iterator[Any]:
    """Yield the numbers of a record in order, those of inner records in their place.

    A number that is not a record is yielded as it is.
    """
    if isinstance(value, tuple):
        for inner in value:
            yield from flat(inner)
    else:
        yield value


def unflat(kind: type, numbers: Iterator[Any]) -> Any:
    """Return a record of this type of the next numbers, the inverse of `flat`."""
    fields = (
        unflat(t, numbers) if is_record(t) else next(numbers) for t in field_types(kind).values()
    )
    return kind(*fields)


def flat_names(kind: type, between: str = "_") -> Iterator[str]:
    """Yield a name for each number of a record, in the order of `flat`.

    Args:
        kind: the record's type.
        between: joins the names of an outer and an inner field.
    """
    for field, inner in field_types(kind).items():
        if is_record(inner):
            for name in flat_names(inner, between):
                yield f"{field}{between}{name}"
        else:
            yield field


def as_rows(records: Sequence[NamedTuple], record: type[NamedTuple]) -> np.ndarray:
    """Return a table of these records, also where there are none.  (records, fields)"""
    return np.array(records, float).reshape(-1, len(record._fields))


def column(rows: np.ndarray, record: type[NamedTuple], name: str) -> np.ndarray:
    """Return a view of the column of a table that holds this field of its records.  (rows,)"""
    return rows[:, record._fields.index(name)]


def columns(rows: np.ndarray, record: type[NamedTuple], first: str, last: str) -> np.ndarray:
    """Return a view of the columns from one field of a table's records to another, both included.

    Args:
        rows: the table  (rows, fields).
        record: the type of its rows.
        first, last: names of fields.

    Returns:
        (rows, columns)
    """
    begin = record._fields.index(first)
    end = record._fields.index(last)
    return rows[:, begin : end + 1]
