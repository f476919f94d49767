"""Claims that the numbers of results on the pages are those of the CSV files."""

from dataclasses import replace
from statistics import fmean

import pytest

from docs.results import fly, refly, tables
from docs.results.experiments import csv_file, experiments, flights_file, read, read_file
from docs.results.flights import Flight, alone

PAGES = sorted(tables.DOCS.glob("**/*.md"))
FLOWN = [name for name in experiments() if csv_file(name).exists()]
WITH_FLIGHTS = [name for name in experiments() if flights_file(name).exists()]
ROOT = tables.DOCS.parent


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_tables_of_a_page_are_those_of_the_files(page):
    text = page.read_text(encoding="utf-8")
    assert tables.written(text) == text, f"run {tables.COMMAND}"


@pytest.mark.parametrize("name", FLOWN)
def test_a_file_has_the_rows_of_its_experiments_command(name):
    assert read(name).command == experiments()[name].command
    rows = read(name).rows
    assert rows
    assert all(
        0 <= int(row["finished"]) <= int(row.get("attempts") or row["flights"])
        for row in rows
        if "finished" in row
    )


@pytest.mark.parametrize("name", ["swift", "song", "alphapilot"])
def test_readme_has_the_laps_and_thrust_variations_of_the_files(name):
    gaussian, colored = read(name).rows
    cells = [gaussian["course"]]
    for row in (gaussian, colored):
        cells += [f"{float(row['lap_mean']):.2f}", f"{float(row['thrust_tv']):.0f}"]
    readme = (ROOT / "README.md").read_text(encoding="utf-8").replace("*", "")
    assert f"| {' | '.join(cells)} |" in readme


@pytest.mark.parametrize("name", ["swift", "alphapilot"])
def test_the_published_times_stand_beside_the_medians_of_the_files(name):
    colored = read(name).rows[1]
    page = (tables.DOCS / "results.md").read_text(encoding="utf-8")
    beside = page.partition("| course | what | published [s] | ours [s] |")[2].partition("\n\n")[0]
    (line,) = (line for line in beside.splitlines() if line.startswith(f"| {colored['course']}"))
    assert line.endswith(f"| {float(colored['race_median']):.3f} |")


def test_the_paper_has_the_laps_of_the_files():
    gaussian, colored = read("swift").rows
    mean, low, high = (float(colored[f"lap_difference{end}"]) for end in ("", "_low", "_high"))
    text = " ".join((tables.DOCS / "joss" / "paper.md").read_text(encoding="utf-8").split())
    assert f"{float(colored['lap_mean']):.2f} s with colored" in text
    assert f"{float(gaussian['lap_mean']):.2f} s with Gaussian" in text
    assert f"{mean:.3f} s (95 % interval {low:.3f} to {high:.3f})" in text


def test_every_file_belongs_to_an_experiment():
    for file in (csv_file("x"), flights_file("x")):
        assert {path.stem for path in file.parent.glob("*.csv")} <= set(experiments())


@pytest.mark.parametrize("name", WITH_FLIGHTS)
def test_the_rows_of_an_experiment_are_those_of_its_flights(name):
    summary, single = read(name), read_file(flights_file(name))
    assert summary.command == single.command
    for row in summary.rows:
        flights = [
            Flight(**flight)
            for flight in single.rows
            if (flight["course"], flight["variant"]) == (row["course"], row["variant"])
        ]
        seeds = [int(flight.seed) for flight in flights]
        assert seeds == list(range(seeds[0], seeds[0] + len(seeds)))
        # A file may have the first flights of a variant alone.
        if len(flights) == int(row["attempts"]):
            assert _summary(flights) == pytest.approx(
                [int(row["finished"]), float(row["lap_mean"]), float(row["thrust_tv"])], rel=1e-5
            )


def _summary(flights):
    """Return the number of flights that finished, their mean lap, and the thrust variation."""
    finished = [flight.laps.split() for flight in flights if flight.outcome == "finished"]
    lap = fmean(fmean(map(float, laps)) for laps in finished)
    return [len(finished), lap, fmean(float(flight.thrust_tv) for flight in flights)]


def test_a_flight_of_an_experiment_is_flown_alone():
    command = "race compare figure8 --attempts 30 --seed 300 --variants race,low=race+samples=64"
    flight = Flight("figure8", "low", "307", "finished", "4.5", "8.0", "40.0")
    words = alone(command, flight)
    assert words[:3] == ["race", "compare", "figure8"]
    flags = dict(zip(words[3::2], words[4::2], strict=True))
    assert flags == {"--attempts": "1", "--seed": "307", "--variants": "low=race+samples=64"}


@pytest.mark.parametrize(("laps", "status"), [("5.43 5.4", 0), ("5.43 5.41", 1)])
def test_a_flight_with_another_lap_is_named(laps, status, monkeypatch, capsys):
    monkeypatch.setattr(refly, "has_documented_digits", lambda: True)
    monkeypatch.setattr(refly, "flights_file", csv_file)  # a file that there is
    there = Flight("c", "v", "7", "finished", "5.43 5.4", "8.0", "40.0")
    drawn = refly.Drawn("swift", "race compare c --variants v", there)
    monkeypatch.setattr(refly, "_listed", lambda names: [drawn])
    monkeypatch.setattr(refly, "_flown", lambda drawn: there._replace(laps=laps))
    assert refly.main(["swift"]) == status
    printed = capsys.readouterr().out
    assert (f"v seed 7: laps: expected 5.43 5.4, got {laps}" in printed) == bool(status)


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


def test_a_table_has_the_same_flights_of_a_sweep_once(monkeypatch):
    def row(setting, value, variant, finished):
        texts = {"setting": setting, "value": value, "variant": variant}
        return texts | {"finished": finished, "attempts": "3"}

    rows = [
        row(setting, value, variant, finished)
        for setting, late in (("link_hz", "40"), ("dt", ".04"))
        for value, finished in (("default", "3"), (late, "2"))
        for variant in ("gaussian", "colored")
    ]
    flown = tables.Flown("race sweep a", "abc", "2026-11-27", "2 cores", rows)
    monkeypatch.setattr(tables, "read", lambda name: flown)
    lines = tables.table(["swift"], ["setting", "value", "variant", "finished"]).splitlines()
    assert [line for line in lines if line.startswith("|")][2:] == [
        "| link_hz | default | gaussian | 3 of 3 |",
        "|  |  | colored | 3 of 3 |",
        "|  | 40 | gaussian | 2 of 3 |",
        "|  |  | colored | 2 of 3 |",
        "| dt | .04 | gaussian | 2 of 3 |",
        "|  |  | colored | 2 of 3 |",
    ]


def test_the_costs_of_table_two_keep_their_sigma_and_the_papers():
    numbers = {"runs": 2, "sd": 3.0, "paper_sd": 4.0}
    cells = [
        {"sampler": name, "sigma": sigma, "mean": mean, "paper_mean": paper, **numbers}
        for name, sigma, mean, paper in (
            ("gaussian", 0.5, 1.0, 5.0),
            ("own", 0.5, 2.0, None),
            ("gaussian", 3.0, 6.0, 7.0),
        )
    ]
    first, second = fly.rows_of({"cells": cells})
    shown = [
        tables.COLUMNS[f"{what}cost_{sigma}"] for sigma in ("05", "3") for what in ("", "paper_")
    ]
    assert [column.text(first) for column in shown] == ["1 ± 3", "5 ± 4", "6 ± 3", "7 ± 4"]
    assert [column.text(second) for column in shown[:2]] == ["2 ± 3", ""]
