"""Summary statistics: pairs by seed, laps of finished attempts only, unfinished attempts always
counted."""

import math
from dataclasses import replace

import pytest

from quadsim.campaign.summary_stats import all_pairs, pair_stats, variant_stats
from quadsim.campaign.tables import as_markdown, comparison_tables, notes
from tests.campaign_cases import row


def test_laps_are_of_finished_attempts_and_the_penalised_mean_is_of_all():
    n = variant_stats(
        "a",
        [row(0, laps=(6.0, 4.0)), row(1, laps=(7.0, 5.0)), row(2, "crashed"), row(3, "timeout")],
        20.0,
    )
    assert (n.attempts, n.finished, n.lap_mean, n.lap_min) == (4, 2, 5.5, 4.0)
    assert n.penalised_mean == (5.0 + 6.0 + 20.0 + 20.0) / 4
    assert (n.race_median, n.flying_median) == (11.0, 4.5)
    assert n.crashes == {"gate 3": 1, "timeout": 1}


def test_accumulated_cost_is_compared_where_the_system_has_one():
    def flown(seed, cost):
        one = row(seed, tv=None)
        return replace(one, result={**one.result, "cost": cost})

    known, unknown = (
        [flown(s, cost) for s, cost in enumerate(costs)] for costs in ((10.0, 30.0), (None, None))
    )
    n = variant_stats("a", known, 20.0)
    assert (n.cost.mean, n.cost.sd) == (20.0, pytest.approx(200**0.5))
    heads = [
        [table.head[1] for table in comparison_tables([variant_stats("a", r, 20.0)], [])]
        for r in (known, unknown)
    ]
    assert "accumulated cost" in heads[0]
    assert "accumulated cost" not in heads[1]


def test_a_variant_that_never_finishes_has_no_laps_but_an_interval_of_success():
    n = variant_stats("a", [row(s, "crashed") for s in range(10)], 20.0)
    assert math.isnan(n.lap_mean)
    assert n.success_ci == (0.0, pytest.approx(0.2775, abs=1e-4))
    assert n.penalised_mean == 20.0


def test_pairing_by_seed_removes_what_the_seeds_share():
    shared = [0.5 * s for s in range(8)]  # what a seed adds to the lap of both
    a = [row(s, laps=(5 + shared[s],)) for s in range(8)]
    b = [row(s, laps=(5.2 + shared[s] + 0.01 * (-1) ** s,)) for s in reversed(range(8))]
    p = pair_stats("a", "b", a, b)
    assert p.lap_difference.mean == pytest.approx(0.2)
    assert p.lap_difference.low > 0.18, "unpaired, a standard deviation of 1.2 s would hide it"
    mixed = [row(7 - s, laps=r.result["laps"]) for s, r in enumerate(a)]
    assert pair_stats("a", "b", mixed, b).lap_difference.low < 0, (
        "negative control: paired with the wrong seeds"
    )


def test_success_is_compared_on_pairs_and_laps_only_where_both_finish():
    a = [row(s, "crashed" if s < 6 else "finished") for s in range(10)]
    b = [row(s, "crashed" if s == 9 else "finished") for s in range(10)]
    p = pair_stats("a", "b", a, b)
    assert (p.only_a, p.only_b, p.lap_difference.n) == (1, 6, 3)
    assert p.success_p == pytest.approx(2 * (1 + 7) / 2**7)


def test_variants_without_a_common_seed_are_compared_unpaired():
    p = pair_stats("a", "b", [row(s) for s in range(5)], [row(s, "crashed") for s in range(5, 10)])
    assert (p.seeds, p.lap_difference.n) == (0, 0)
    assert p.success_p == pytest.approx(2 / 252), "Fisher's"


def test_ratio_of_chatter_is_symmetric():
    a, b = ([row(s, tv=v) for s, v in enumerate(tvs)] for tvs in ((10, 20), (20, 10)))
    assert pair_stats("a", "b", a, b).thrust_tv_ratio.mean == pytest.approx(1.0)


def test_report_warns_of_mixed_commits_and_dirty_ones_and_always_counts_unfinished_attempts():
    rows = [[row(0), row(1, "crashed")], [row(0, code="b" * 40 + "-dirty"), row(1)]]
    variants = [variant_stats(name, r, 20.0) for name, r in zip("ab", rows, strict=True)]
    pairs = all_pairs("ab", rows)
    said = "\n".join(notes(variants, pairs, 20.0))
    assert "MIXED COMMITS: a: aaaaaaa; b: aaaaaaa, bbbbbbb+" in said
    assert "cannot be reproduced" in said
    assert "20.0 s a lap" in said
    laps = as_markdown(next(iter(comparison_tables(variants, pairs))))
    assert "| a | 1/2 |" in laps
    assert "| b | 2/2 |" in laps
    assert "MIXED" not in "\n".join(notes(variants[:1], [], 20.0)), "one commit is not mixed"
