"""Rows of equal keys as the text of a CSV file."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from io import StringIO


def csv_text(rows: Sequence[Mapping[str, object]], columns: Sequence[str] | None = None) -> str:
    r"""Return a CSV file: a line of names, then one line for each row, each ended by \r\n.

    Args:
        rows: name of a column -> value.
        columns: the names in their order; None: those of the first row, of which there must be one.
    """
    names = list(rows[0]) if columns is None else columns
    text = StringIO(newline="")
    writer = csv.DictWriter(text, names)
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
