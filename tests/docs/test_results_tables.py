"""Claims that the numbers of results on the pages are those of the CSV files."""

from dataclasses import replace

import pytest

from docs.results import fly, tables
from docs.results.experiments import csv_file, experiments, read

PAGES = sorted(tables.DOCS.glob("**/*.md"))
FLOWN = [name for name in experiments() if csv_file(name).exists()]
ROOT = tables.DOCS.parent


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_tables_of_a_page_are_those_of_the_files(page):
    text = page.read_text(encoding="utf-8")
    assert tables.written(text) == text, f"run {tables.COMMAND}"


@pytest.mark.parametrize("name", FLOWN)
def test_a_file_has_the_rows_of_its_experiments_command(name):
    assert read(name).command == experiments()[name].command
    assert all(int(row["finished"]) >= 0 for row in read(name).rows)


@pytest.mark.parametrize("name", ["swift", "song", "alphapilot"])
def test_readme_has_the_laps_and_thrust_variations_of_the_files(name):
    gaussian, colored = read(name).rows
    cells = [gaussian["course"]]
    for row in (gaussian, colored):
        cells += [f"{float(row['lap_mean']):.2f}", f"{float(row['thrust_tv']):.0f}"]
    readme = (ROOT / "README.md").read_text(encoding="utf-8").replace("*", "")
    assert f"| {' | '.join(cells)} |" in readme


def test_the_paper_has_the_laps_of_the_files():
    gaussian, colored = read("swift").rows
    mean, low, high = (float(colored[f"lap_difference{end}"]) for end in ("", "_low", "_high"))
    text = " ".join((tables.DOCS / "joss" / "paper.md").read_text(encoding="utf-8").split())
    assert f"{float(colored['lap_mean']):.2f} s with colored" in text
    assert f"{float(gaussian['lap_mean']):.2f} s with Gaussian" in text
    assert f"{mean:.3f} s (95 % interval {low:.3f} to {high:.3f})" in text


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


def test_a_sweep_has_a_row_for_each_variant_at_each_value():
    mean = {"mean": 0.2, "sd": 0.1, "n": 3, "low": -0.1, "high": 0.5}
    rate = {"crashes": 1, "passed": 19, "per_100": 5.0, "low": 1.0, "high": 24.0}
    stats = {"attempts": 3, "finished": 2, "success_ci": [0.2, 0.9], "crash_rate": rate}
    stats |= {"race_median": 5.2, "commits": ["a" * 40]}
    place = {"course": "a", "setting": "link_hz"}
    points = [
        {**place, "variant": "gaussian", "value": "100", "stats": stats, "change": None},
        {**place, "variant": "gaussian", "value": "40", "stats": stats, "change": mean},
        {**place, "variant": "colored", "value": "100", "stats": stats, "change": None},
        {**place, "variant": "colored", "value": "40", "stats": stats, "change": mean | {"n": 2}},
    ]
    for point in points:
        point["change"] = point["change"] and {"lap_difference": point["change"]}
    rows = list(fly.rows_of({"points": points}))
    assert [(row["value"], row["variant"]) for row in rows] == [
        ("100", "gaussian"),
        ("100", "colored"),
        ("40", "gaussian"),
        ("40", "colored"),
    ]
    change = tables.COLUMNS["lap_change"].text
    # The first value is no change, and two pairs have no interval.
    assert list(map(change, rows)) == ["", "", "+0.200 (-0.100 to +0.500)", "+0.200"]
    assert tables.COLUMNS["crash_rate"].text(rows[0]) == "5.0 (1.0 to 24.0)"
