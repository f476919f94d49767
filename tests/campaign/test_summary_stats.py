"""Summary statistics: pairs by seed, laps of finished attempts only, unfinished attempts always
counted."""

import math

import pytest

from quadsim.campaign.document import as_markdown
from quadsim.campaign.flights.stats import against, all_pairs, pair_stats, variant_stats
from quadsim.campaign.flights.tables import comparison_tables, notes
from quadsim.statistics import holm
from tests.campaign_cases import row

LIMIT = 20.0  # of a lap [s]


def test_laps_are_of_finished_attempts_and_the_penalised_mean_is_of_all():
    rows = [row(0, laps=(6.0, 4.0)), row(1, laps=(7.0, 5.0)), row(2, "crashed"), row(3, "timeout")]
    stats = variant_stats("a", rows, LIMIT)
    assert (stats.attempts, stats.finished, stats.lap_mean, stats.lap_min) == (4, 2, 5.5, 4.0)
    assert stats.penalised_mean == (5.0 + 6.0 + LIMIT + LIMIT) / 4
    assert (stats.race_median, stats.flying_median) == (11.0, 4.5)
    assert stats.crashes == {"gate 3": 1, "timeout": 1}


def test_a_variant_that_never_finishes_has_no_laps_but_an_interval_of_success():
    stats = variant_stats("a", [row(s, "crashed") for s in range(10)], LIMIT)
    assert math.isnan(stats.lap_mean)
    assert stats.success_ci == (0.0, pytest.approx(0.2775, abs=1e-4))
    assert stats.penalised_mean == LIMIT


def test_crashes_are_counted_per_gate_that_a_flight_came_to():
    rows = [row(0, gates=7), row(1, "crashed", gates=2), row(2, "stuck", gates=1)]
    rate = variant_stats("a", rows, LIMIT).crash_rate
    assert (rate.crashes, rate.passed, rate.per_100) == (1, 10, pytest.approx(100 / 11))
    assert rate.low < rate.per_100 < rate.high
    at_once = [row(seed, "crashed", gates=0) for seed in range(3)]
    assert variant_stats("a", at_once, LIMIT).crash_rate.per_100 == 100.0


def test_pairing_by_seed_removes_what_the_seeds_share():
    shared = [0.5 * s for s in range(8)]  # what a seed adds to the lap of both
    a = [row(s, laps=(5 + shared[s],)) for s in range(8)]
    b = [row(s, laps=(5.2 + shared[s] + 0.01 * (-1) ** s,)) for s in reversed(range(8))]
    pair = pair_stats("a", "b", a, b)
    assert pair.lap_difference.mean == pytest.approx(0.2)
    assert pair.lap_difference.low > 0.18, "unpaired, a standard deviation of 1.2 s would hide it"
    mixed = [row(7 - s, laps=r.result["laps"]) for s, r in enumerate(a)]
    assert pair_stats("a", "b", mixed, b).lap_difference.low < 0, (
        "negative control: paired with the wrong seeds"
    )


def test_success_is_compared_on_pairs_and_laps_only_where_both_finish():
    a = [row(s, "crashed" if s < 6 else "finished") for s in range(10)]
    b = [row(s, "crashed" if s == 9 else "finished") for s in range(10)]
    pair = pair_stats("a", "b", a, b)
    assert (pair.only_a, pair.only_b, pair.lap_difference.n) == (1, 6, 3)
    assert pair.success_p == pytest.approx(2 * (1 + 7) / 2**7)


def test_variants_without_a_common_seed_are_compared_unpaired():
    a = [row(s) for s in range(5)]
    b = [row(s, "crashed") for s in range(5, 10)]
    pair = pair_stats("a", "b", a, b)
    assert (pair.seeds, pair.lap_difference.n) == (0, 0)
    assert pair.success_p == pytest.approx(2 / 252), "Fisher's"


def test_the_ratio_of_chatter_is_symmetric():
    a = [row(s, tv=tv) for s, tv in enumerate((10, 20))]
    b = [row(s, tv=tv) for s, tv in enumerate((20, 10))]
    assert pair_stats("a", "b", a, b).thrust_tv_ratio.mean == pytest.approx(1.0)


def test_a_report_warns_of_mixed_commits_and_of_changed_files():
    rows = [[row(0), row(1, "crashed")], [row(0, code="b" * 40 + "-dirty"), row(1)]]
    variants = [variant_stats(name, r, LIMIT) for name, r in zip("ab", rows, strict=True)]
    text = "\n".join(notes(variants, all_pairs("ab", rows), LIMIT))
    assert "MIXED COMMITS: a: aaaaaaa; b: aaaaaaa, bbbbbbb+" in text
    assert "cannot be reproduced" in text
    assert "MIXED" not in "\n".join(notes(variants[:1], [], LIMIT)), "one commit is not mixed"


def test_tables_always_count_unfinished_attempts():
    rows = [[row(0), row(1, "crashed")], [row(0), row(1)]]
    variants = [variant_stats(name, r, LIMIT) for name, r in zip("ab", rows, strict=True)]
    laps = as_markdown(next(comparison_tables(variants, [])))
    assert "| a | 1/2 |" in laps
    assert "| b | 2/2 |" in laps


def many(count, seeds=6):
    """Return names and rows of variants; each has laps longer by 0.1 s than the one before."""
    names = [f"v{k}" for k in range(count)]
    rows = [
        [row(s, laps=(5.0 + 0.1 * k + 0.01 * ((7 * s * k) % 5), 4.0)) for s in range(seeds)]
        for k in range(count)
    ]
    return names, rows


def stats_of(names, rows):
    return [variant_stats(name, r, LIMIT) for name, r in zip(names, rows, strict=True)]


def test_against_a_baseline_every_p_is_corrected_for_the_number_of_variants():
    names, rows = many(5)
    rows[4] = [row(s, "crashed") for s in range(6)]
    pairs = against("v2", names, rows)
    assert [(p.a, p.b) for p in pairs] == [("v2", name) for name in ("v0", "v1", "v3", "v4")]
    corrected = [p.corrected for p in pairs if p.corrected]
    assert [c.laps for c in corrected] == pytest.approx(holm([p.lap_p for p in pairs]), nan_ok=True)
    assert pairs[3].success_p == pytest.approx(2 / 2**6)
    assert corrected[3].success == pytest.approx(4 * 2 / 2**6)
    assert math.isnan(corrected[3].laps)
    assert against("nobody", names, rows) == []


def test_a_table_against_a_baseline_has_a_row_for_each_other_variant_and_says_what_p_is():
    names, rows = many(9)
    pairs = against("v8", names, rows)
    *_, table = comparison_tables(stats_of(names, rows), pairs)
    assert table.head[0] == "variant less\nv8"
    assert [cells[0] for cells in table.rows] == names[:8]
    assert "p: corrected for 8 variants against v8 (Holm)" in "\n".join(
        notes(stats_of(names, rows), pairs, LIMIT)
    )


@pytest.mark.parametrize(("count", "shown"), [(2, 1), (6, 15), (7, 6), (9, 8)])
def test_of_many_variants_the_pairs_with_the_first_are_shown_and_the_others_said(count, shown):
    names, rows = many(count)
    pairs = all_pairs(names, rows)
    *_, table = comparison_tables(stats_of(names, rows), pairs)
    assert len(table.rows) == shown
    text = "\n".join(notes(stats_of(names, rows), pairs, LIMIT))
    assert (f"Pairs: {shown} of {len(pairs)}, those with v0" in text) == (count > 6)


@pytest.mark.parametrize(("seeds", "brackets"), [(2, False), (3, True)])
def test_fewer_than_three_pairs_have_no_interval(seeds, brackets):
    names, rows = many(2, seeds)
    *_, table = comparison_tables(stats_of(names, rows), all_pairs(names, rows))
    (cells,) = table.rows
    assert ("[" in cells[1]) == ("[" in cells[5]) == brackets
    text = "\n".join(notes(stats_of(names, rows), all_pairs(names, rows), LIMIT))
    assert ("detect with power" in text) == brackets


def test_every_time_of_a_table_has_its_unit():
    names, rows = many(2)
    laps, chatter, pairs = comparison_tables(stats_of(names, rows), all_pairs(names, rows))
    times = ("lap", "sd", "best", "race", "flying", "penalised")
    assert [head for head in laps.head if head.split("\n")[0] in times] == [
        f"{name}\n[s]" for name in times
    ]
    assert {"thrust\n[m/s^2/s]", "delivered\n[m/s^2/s]", "plan\n[ms]"} <= set(chatter.head)
    assert "lap difference\n[s]" in pairs.head
