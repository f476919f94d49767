"""Intervals cover, tests keep their level, power is as stated: published values and seeded
simulations."""

from math import isnan, nan

import numpy as np
import pytest

from quadsim.statistics import (
    clustered_mean,
    clustered_wilson,
    detectable,
    false_alarm,
    fisher,
    holm,
    mcnemar,
    mean_interval,
    p_of_mean,
    p_of_ratio,
    proportion_difference,
    ratio_interval,
    upper_bound,
    wilson,
)

# Student's sleep data: hours more with one drug than with the other
EXTRA = (
    [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0],
    [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4],
)
DIFFERENCES = [b - a for a, b in zip(*EXTRA, strict=True)]


def test_t_interval_of_student_s_sleep_data():
    result = mean_interval(DIFFERENCES)
    assert (result.mean, result.low, result.high) == pytest.approx((1.58, 0.7001, 2.4599), abs=1e-4)


def test_t_interval_covers_95_percent_where_the_normal_one_does_not():
    x = np.random.default_rng(0).standard_normal((4000, 5))
    intervals = [mean_interval(row) for row in x]
    covered = np.mean([i.low < 0 < i.high for i in intervals])
    normal = np.mean([abs(i.mean) < 1.96 * i.sd / 5**0.5 for i in intervals])
    assert covered == pytest.approx(0.95, abs=0.011), "3 standard errors of 4000 trials"
    assert normal < 0.92, "the negative control undercovers"


@pytest.mark.parametrize(("values", "n"), [([], 0), ([3.0], 1)])
def test_too_few_values_give_no_interval(values, n):
    result = mean_interval(values)
    assert result.n == n
    assert np.isnan(result.low)
    assert np.isnan(upper_bound(values))


@pytest.mark.parametrize("n", [2, 3, 10, 100])
def test_detectable_effect_is_seen_in_as_many_simulated_experiments_as_the_power_says(n):
    x = np.random.default_rng(1).normal(detectable(0.3, n), 0.3, (4000, n))
    seen = np.mean([not (i.low < 0 < i.high) for i in map(mean_interval, x)])
    assert seen == pytest.approx(0.8, abs=0.02), "3 standard errors of 4000 trials"


def test_upper_bound_has_the_miss_and_false_alarm_rates_that_are_stated():
    n, sd, effect = 12, 0.02, 0.03
    rng = np.random.default_rng(2)
    passes = np.mean([upper_bound(x) < effect for x in rng.normal(effect, sd, (4000, n))])
    assert passes == pytest.approx(0.05, abs=0.011)
    alarms = np.mean([upper_bound(x) >= effect for x in rng.normal(0.0, sd, (4000, n))])
    assert alarms == pytest.approx(false_alarm(sd, n, effect, 0.95), abs=0.01)


def test_fisher_s_tea_and_the_paper_s_success_rates():
    assert fisher(3, 4, 1, 4) == pytest.approx(0.4857, abs=1e-4)
    assert fisher(9, 37, 9, 21) == pytest.approx(0.24, abs=0.005), (
        "24 % and 43 % are not told apart"
    )
    assert fisher(24, 100, 43, 100) < 0.01, "with a hundred each they would be"


def test_mcnemar_counts_only_pairs_that_differ():
    assert mcnemar(0, 0) == 1.0
    assert mcnemar(0, 6) == pytest.approx(2 / 64)
    assert mcnemar(5, 5) == 1.0
    assert mcnemar(3, 9) == mcnemar(9, 3)


@pytest.mark.parametrize(
    ("counts", "low", "high"),
    [((48, 80, 56, 70), 0.0524, 0.3339), ((0, 10, 0, 10), -0.2775, 0.2775)],
)
def test_difference_of_proportions_has_newcombe_s_published_interval(counts, low, high):
    assert proportion_difference(*counts) == pytest.approx((low, high), abs=1e-4)


@pytest.mark.parametrize(
    ("k", "n", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_gives_newcombe_s_published_intervals(k, n, low, high):
    """Newcombe 1998, Statistics in Medicine 17, table I, method 3."""
    assert wilson(k, n) == pytest.approx((low, high), abs=5e-5)


def test_no_crash_in_ten_flights_says_under_28_percent_and_in_100_under_3_7():
    assert wilson(0, 10) == (0.0, pytest.approx(0.2775, abs=1e-4))
    assert wilson(0, 100)[1] == pytest.approx(0.037, abs=1e-4)
    assert wilson(10, 10)[1] == 1.0


def grouped(p, alike, groups, size, trials):
    """Return the successes of groups of trials. alike: 0 independent, 1 the same in a group."""
    rng = np.random.default_rng(5)
    shape = (trials, groups)
    if alike == 0.0:
        chances = np.full(shape, p)
    elif alike == 1.0:
        chances = (rng.random(shape) < p).astype(float)
    else:
        scale = (1.0 - alike) / alike
        chances = rng.beta(p * scale, (1.0 - p) * scale, shape)
    return rng.binomial(size, chances)


@pytest.mark.parametrize("alike", [0.0, 0.3, 1.0])
@pytest.mark.parametrize(("p", "groups"), [(0.5, 64), (0.9, 16)])
def test_an_interval_by_group_covers_where_trials_of_a_group_are_alike(p, alike, groups):
    """And the one of independent trials does not."""
    size = 4
    drawn = grouped(p, alike, groups, size, trials=500)
    by_group = [clustered_wilson(k, [size] * groups) for k in drawn]
    pooled = [wilson(int(k.sum()), size * groups) for k in drawn]
    covered, naive = (
        np.mean([low <= p <= high for low, high in found]) for found in (by_group, pooled)
    )
    assert covered >= 0.92
    assert naive < (0.9 if alike else 0.99)


def test_a_mean_by_group_covers_where_values_of_a_group_are_alike():
    rng = np.random.default_rng(6)
    groups, size = 16, 4
    shared = rng.standard_normal((1000, groups, 1))
    values = shared + 0.5 * rng.standard_normal((1000, groups, size))
    by_group = [clustered_mean(list(x)) for x in values]
    pooled = [mean_interval(x.ravel()) for x in values]
    covered, naive = (np.mean([m.low < 0 < m.high for m in found]) for found in (by_group, pooled))
    assert 0.93 <= covered <= 0.97
    assert naive < 0.8


def test_groups_of_one_are_independent_values():
    values = [1.0, 2.0, 4.0, 8.0]
    by_group, plain = clustered_mean([[x] for x in values]), mean_interval(values)
    assert (by_group.low, by_group.high) == pytest.approx((plain.low, plain.high))
    assert clustered_mean([[1.0, 2.0], []]).n == 2
    assert np.isnan(clustered_mean([[1.0, 2.0], []]).low)
    assert np.isnan(clustered_mean([]).mean)


def test_136_of_256_flights_that_are_alike_within_64_races():
    """All four of a race finish, or none: as many as 34 of 64 races."""
    low, high = clustered_wilson([4] * 34 + [0] * 30, [4] * 64)
    assert (low, high) == pytest.approx(wilson(34, 64), abs=0.005)
    assert high - low > 1.9 * np.diff(wilson(136, 256))[0]


def test_the_paired_t_test_has_the_published_p_of_student_s_sleep_data():
    assert p_of_mean(mean_interval(DIFFERENCES)) == pytest.approx(0.002833, abs=1e-6)
    assert p_of_mean(mean_interval([0.0, 0.0, 0.0])) == 1.0
    assert p_of_mean(mean_interval([0.5, 0.5, 0.5])) == 0.0
    assert isnan(p_of_mean(mean_interval([0.5])))


def test_the_p_of_a_ratio_is_that_of_its_logarithm():
    pairs = [(1.0, float(np.exp(difference))) for difference in DIFFERENCES]
    assert p_of_ratio(ratio_interval(pairs)) == pytest.approx(0.002833, abs=1e-6)


@pytest.mark.parametrize(
    ("ps", "corrected"),
    [
        # p.adjust(p, "holm") of R
        ([0.01, 0.02, 0.03, 0.04, 0.05], [0.05, 0.08, 0.09, 0.09, 0.09]),
        ([0.01, 0.04, 0.03, 0.005], [0.03, 0.06, 0.06, 0.02]),
        ([0.6, 0.5], [1.0, 1.0]),
        ([0.04], [0.04]),
        ([nan, 0.02, 0.04], [nan, 0.04, 0.04]),
        ([], []),
    ],
)
def test_holm_gives_known_corrected_values(ps, corrected):
    assert holm(ps) == pytest.approx(corrected, nan_ok=True)


def rejected(shift, correct):
    """Return for how many of 1000 comparisons a test of equal variants against a baseline is below
    5 %, and for how many the test of a variant that is slower by `shift` standard deviations is.

    The baseline is shared, so that the tests depend on each other.
    """
    rng = np.random.default_rng(3)
    false_ones, found = 0, 0
    for _ in range(1000):
        laps = rng.standard_normal((9, 10))
        laps[8] += shift
        ps = correct([p_of_mean(mean_interval(each - laps[0])) for each in laps[1:]])
        false_ones += min(ps[:7]) < 0.05
        found += ps[7] < 0.05
    return false_ones / 1000, found / 1000


def test_holm_keeps_the_share_of_comparisons_with_any_false_difference_below_5_percent():
    false_ones, found = rejected(2.5, holm)
    assert false_ones < 0.05 + 3 * (0.05 * 0.95 / 1000) ** 0.5
    assert found > 0.8, "a large difference is found nevertheless"
    uncorrected, _ = rejected(2.5, list)
    assert uncorrected > 0.15, "without the correction one comparison in five has one"
