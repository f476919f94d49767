"""Claims that the tables of results on the pages are those of the CSV files."""

from dataclasses import replace

import pytest

from docs.results import tables
from docs.results.experiments import csv_file, experiments, read

PAGES = sorted(tables.DOCS.glob("**/*.md"))
FLOWN = [name for name in experiments() if csv_file(name).exists()]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_tables_of_a_page_are_those_of_the_files(page):
    text = page.read_text(encoding="utf-8")
    assert tables.written(text) == text, f"run {tables.COMMAND}"


@pytest.mark.parametrize("name", FLOWN)
def test_a_file_has_the_rows_of_its_experiments_command(name):
    assert read(name).command == experiments()[name].command
    assert all(int(row["finished"]) >= 0 for row in read(name).rows)


def test_every_file_belongs_to_an_experiment():
    folder = csv_file("x").parent
    assert {path.stem for path in folder.glob("*.csv")} <= set(experiments())


def test_a_changed_row_changes_the_table(monkeypatch):
    row = {"variant": "gaussian", "finished": "3", "attempts": "4", "race_median": "15.9"}
    flown = tables.Flown("race compare a", "abc", "2026-11-27", "2 cores", [row])
    monkeypatch.setattr(tables, "read", lambda name: flown)
    page = "<!-- results swift: variant, finished, race -->\n\n<!-- end of results -->\n"
    before = tables.written(page)
    assert "| gaussian | 3 of 4 | 15.900 |" in before
    assert tables.written(before) == before
    slower = replace(flown, rows=[row | {"race_median": "16.0"}])
    monkeypatch.setattr(tables, "read", lambda name: slower)
    assert "| gaussian | 3 of 4 | 16.000 |" in tables.written(before)
