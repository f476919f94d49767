"""Tables of comparisons fit a terminal of 80 columns without breaking a word."""

from io import StringIO
from math import nan

import pytest
from rich.console import Console
from rich.padding import Padding

from quadsim.campaign.document import Document, Table, as_markdown, as_table
from quadsim.campaign.flights.results import StoredVariant, group_blocks
from quadsim.campaign.flights.stats import all_pairs, variant_stats
from quadsim.campaign.flights.tables import comparison_tables
from quadsim.console import as_text
from tests.campaign_cases import row

NAMES = ("log_normal", "smooth_star", "gaussian", "colored")
COURSE = "split_s_swift"
NUMBERS = ("5.555", "-0.743 [-0.890, -0.597]", "x 0.65 [0.55, 0.77]")


def printed(table, columns=80):
    console = Console(file=StringIO(), width=columns, highlight=False)
    console.print(Padding(as_table(table, columns), (0, 0, 0, 2), expand=False))
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines())


def comparison(outcome="finished"):
    """Four variants of a hundred attempts with laps of ten to twenty seconds; outcome: of the first
    three of each."""
    rows = [
        [
            row(seed, outcome if seed < 3 else "finished", laps=(16.0 + k, 12.5 + 0.001 * seed))
            for seed in range(100)
        ]
        for k in range(len(NAMES))
    ]
    variants = [variant_stats(name, r, 20.0) for name, r in zip(NAMES, rows, strict=True)]
    return list(comparison_tables(variants, all_pairs(NAMES, rows)))


@pytest.mark.parametrize("k", range(3))
def test_a_comparison_of_80_columns_has_every_name_whole_in_the_first_column(k):
    table = comparison("crashed")[k]
    lines = printed(table).splitlines()
    assert max(map(len, lines)) <= 80
    for cells in table.rows:
        of_row = [line[2:] for line in lines if line[2:].startswith(f"{cells[0]} ")]
        assert of_row
        assert all(cell in " ".join(of_row) for cell in cells)


def test_laps_of_a_hundred_attempts_are_one_table_and_pairs_are_two():
    laps, _, pairs = (printed(table) for table in comparison())
    assert "\n\n" not in laps
    first, second = pairs.split("\n\n")
    assert "lap difference" in first
    assert "thrust variation" in second
    assert "\n\n" not in printed(comparison()[2], columns=120)


@pytest.mark.parametrize("columns", [60, 80, 200])
def test_no_word_of_any_table_is_broken(columns):
    table = Table(
        ("id", "variant", "course", "lap [s]", "lap difference [s]", "thrust", "ended at"),
        tuple(
            (f"id{i}", name, COURSE, *NUMBERS, ", ".join(f"{n} gate {n}" for n in range(9)))
            for i, name in enumerate(NAMES)
        ),
        texts=(1, 2, 6),
    )
    text = printed(table, columns)
    assert max(map(len, text.splitlines())) <= columns
    assert {*text.split()} == {
        word for cells in (table.head, *table.rows) for cell in cells for word in cell.split()
    }


def test_a_name_wider_than_the_terminal_is_wrapped_and_nothing_of_it_is_lost():
    name = "x" * 100
    text = printed(Table(("variant", "lap"), ((name, "5.555"),)))
    assert text.count("x") == len(name)
    assert "5.555" in text


def test_heads_of_two_lines_are_one_in_markdown():
    assert (
        as_markdown(Table(("variant", "lap\n[s]"), (("a", "5.5"),))).splitlines()[0]
        == "| variant | lap [s] |"
    )


def test_stored_variants_of_long_names_are_one_table_of_80_columns(
    monkeypatch,
):
    names = {"course": "split_s_swift", "vehicle": "kingfisher", "randomize": 1.0}
    groups = [
        StoredVariant((row(0, **names, variant=f"{k}" * 64, name=name),), 10.0)
        for k, name in enumerate(NAMES)
    ]
    monkeypatch.setenv("COLUMNS", "80")
    lines = as_text(*Document(tuple(group_blocks(groups))).renderables()).splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0] == "  course split_s_swift, vehicle kingfisher, randomized 1, commit aaaaaaa"
    assert [line.split()[1] for line in lines[4:]] == list(NAMES)


def test_the_share_above_the_best_known_limit_is_a_column_where_one_is_known():
    groups = [
        StoredVariant((row(0, variant="a" * 64, laps=(5.0, 5.0)),), 10.0, best)
        for best in (8.0, nan)
    ]
    _, table = group_blocks(groups)
    assert [row[table.head.index("above [%]")] for row in table.rows] == ["25.0", "-"]
