"""Values as CSV and JSON hold them."""

import csv
import io
from math import inf, nan

import pytest

from quadsim.files.csv_rows import csv_text
from quadsim.files.json_values import without_nan


def test_rows_are_read_back_from_their_csv():
    rows = [{"name": 'a "b", c', "x": 0.1}, {"name": "line\nbreak", "x": 1e-300}]
    read = list(csv.DictReader(io.StringIO(csv_text(rows), newline="")))
    assert [(r["name"], float(r["x"])) for r in read] == [(r["name"], r["x"]) for r in rows]


def test_without_rows_there_are_the_names():
    assert csv_text([], ["t", "x"]) == "t,x\r\n"


def test_a_row_with_another_column_is_refused():
    with pytest.raises(ValueError, match="y"):
        csv_text([{"x": 1}, {"x": 1, "y": 2}])


def test_nan_and_infinity_become_none_at_any_depth():
    value = {"a": nan, "b": [1.0, -inf, {"c": (inf, "x", 3)}], "d": None, "e": True}
    expected = {"a": None, "b": [1.0, None, {"c": [None, "x", 3]}], "d": None, "e": True}
    assert without_nan(value) == expected
