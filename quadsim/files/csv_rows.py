"""Write rows with equal keys as the text of a CSV file."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from io import StringIO


def csv_text(rows: Sequence[Mapping[str, object]], columns: Sequence[str] | None = None) -> str:
    r"""Return a CSV file: a line of names, then one line for each row, each ended by \r\n.

    Args:
        rows: values by the names of columns.
        columns: the names in order; None: the names in the first row, which must exist.
    """
    names = list(rows[0]) if columns is None else columns
    text = StringIO(newline="")
    writer = csv.DictWriter(text, names)
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()
