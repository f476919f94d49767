"""Claims about a comparison as its user meets it: each flight, pandas, JSON, a notebook."""

import json
import re
from dataclasses import asdict, replace
from pathlib import Path
from statistics import fmean, stdev

import numpy as np
import pytest

import quadsim
from quadsim.campaign.flights.compare import Comparison
from quadsim.campaign.flights.stats import Section, all_pairs, variant_stats
from tests.campaign_cases import COURSE, SETTINGS, row

NAMES = ("a", "b")


def made(finished=4, names=NAMES):
    """Return a comparison of two variants of five attempts; the first `finished` of each finish."""
    rows = [
        [
            row(
                seed,
                "finished" if seed < finished else "crashed",
                laps=(16.0 + k, 12.5 + 0.1 * seed) if seed < finished else (),
            )
            for seed in range(5)
        ]
        for k in range(len(names))
    ]
    section = Section(
        course=quadsim.load_course(COURSE),
        setting="2 laps",
        limit=20.0,
        variants=[variant_stats(n, r, 20.0) for n, r in zip(names, rows, strict=True)],
        pairs=all_pairs(names, rows),
        rows=rows,
        home=Path("somewhere"),
    )
    return Comparison([section])


@pytest.mark.compiled
def test_there_is_one_record_for_each_flight():
    flown = quadsim.compare(COURSE, ("gaussian", "colored"), attempts=2, **SETTINGS)
    found = [(a.variant, a.seed) for a in flown.attempts]
    assert found == [(name, seed) for name in ("gaussian", "colored") for seed in (0, 1)]
    for attempt in flown.attempts:
        run = quadsim.load_run(attempt.folder)
        assert (run.outcome, run.spec["seed"]) == (attempt.outcome, attempt.seed)
        assert attempt.thrust_tv == run.metrics.thrust_tv
        assert attempt.thrust_tv_delivered == run.metrics.thrust_tv_delivered
        assert attempt.rates_tv == run.metrics.rates_tv
        assert attempt.plan_ms == run.metrics.plan_ms_p50


def test_the_numbers_of_a_variant_are_those_of_its_attempts():
    comparison = made()
    for variant in comparison.variants:
        attempts = [a for a in comparison.attempts if a.variant == variant.name]
        done = [a for a in attempts if a.outcome == "finished"]
        assert len(attempts) == variant.attempts
        assert len(done) == variant.finished
        assert fmean(a.lap_mean for a in done) == pytest.approx(variant.lap_mean)
        assert np.median([a.race_time for a in done]) == pytest.approx(variant.race_median)
        assert fmean(a.thrust_tv for a in attempts) == pytest.approx(variant.thrust_tv)
        ends = [a.ended_at for a in attempts if a.ended_at]
        assert {end: ends.count(end) for end in ends} == variant.crashes


def test_an_attempt_that_did_not_finish_has_no_times():
    last = made().attempts[4]
    assert (last.outcome, last.laps, last.lap_mean, last.race_time) == ("crashed", (), None, None)


def test_pandas_has_a_row_for_each_flight():
    pytest.importorskip("pandas")
    comparison = made()
    frame = comparison.to_pandas()
    assert frame["seed"].tolist() == [a.seed for a in comparison.attempts]
    assert list(frame.columns) == list(asdict(comparison.attempts[0]))
    assert Comparison([]).to_pandas().columns.tolist() == list(frame.columns)


def test_json_has_no_nan():
    numbers = made(finished=0).as_json()
    text = json.dumps(numbers, allow_nan=False)
    assert numbers["variants"][0]["lap_mean"] is None
    assert numbers["pairs"][0]["lap_difference"]["mean"] is None
    assert "NaN" not in text


def test_the_sd_of_the_thrust_ratio_is_that_of_logarithms():
    comparison = made()
    section = comparison.sections[0]
    louder = []
    for k, of_a in enumerate(section.rows[0]):
        varied = of_a.result["thrust_tv"] | {"commanded": of_a.result["thrust_tv"]["commanded"]}
        varied["commanded"] *= 2.0 ** (k % 2)
        louder.append(replace(of_a, result=of_a.result | {"thrust_tv": varied}))
    (pair,) = all_pairs(NAMES, [section.rows[0], louder])
    logs = [np.log(2.0) * (k % 2) for k in range(len(louder))]
    assert pair.thrust_tv_ratio.sd == pytest.approx(stdev(logs))
    assert pair.thrust_tv_ratio.mean == pytest.approx(np.exp(fmean(logs)))


def test_repr_is_one_line():
    assert repr(made()) == f"<Comparison {COURSE}: a, b, 10 flights>"


@pytest.mark.slow
def test_the_notebook_shows_tables_and_figure_and_escapes_names():
    html = made(names=("<b>x</b>", "b"))._repr_html_()
    assert html.count("<table") == 3
    assert len(re.findall(r'src="data:image/png;base64,', html)) == 1
    assert "<b>x</b>" not in html
    assert "&lt;b&gt;x&lt;/b&gt;" in html
    assert Comparison([])._repr_html_() == "<div></div>"


@pytest.mark.parametrize(
    ("variants", "baseline", "said"),
    [
        (("gaussian", "colored"), "coloured", "baseline: no variant 'coloured', did you mean"),
        (("gaussian",), "gaussian", "baseline: expected another variant beside 'gaussian'"),
    ],
)
def test_a_baseline_that_is_no_other_variant_is_one_line_before_any_flight(
    variants, baseline, said
):
    with pytest.raises(quadsim.SettingError, match=rf"^{said}"):
        quadsim.compare(COURSE, variants, attempts=1, baseline=baseline, **SETTINGS)


@pytest.mark.compiled
def test_a_comparison_with_a_baseline_has_a_pair_for_each_other_variant():
    flown = quadsim.compare(
        COURSE, ("gaussian", "colored", "smooth"), attempts=2, baseline="colored", **SETTINGS
    )
    assert [(pair.a, pair.b) for pair in flown.pairs] == [
        ("colored", "gaussian"),
        ("colored", "smooth"),
    ]
    (first, _) = flown.as_json()["pairs"]
    assert first["corrected"] == {"laps": None, "success": 1.0, "thrust_tv": None}


def test_the_figure_has_a_panel_of_paired_differences_with_intervals():
    comparison = made(names=("a", "b", "c"))
    row_of_course = comparison.plot().subfigs[0]
    titles = [axes.get_title("left") for axes in row_of_course.axes]
    (panel,) = [k for k, title in enumerate(titles) if title.startswith("lap less that of a")]
    texts = [text.get_text() for text in row_of_course.axes[panel].texts]
    assert texts[0] == "the others are compared with it"
    assert texts[1].startswith("+0.500  (n 4")
    (alone,) = made(names=("a",)).plot().subfigs
    assert not any("less that of" in axes.get_title("left") for axes in alone.axes)


def test_the_figure_of_one_course_fits_a_slide():
    figure = made(names=("a", "b", "c")).plot()
    width, height = figure.get_size_inches()
    assert width / height == pytest.approx(16 / 9, rel=0.01)
    # Both rows of axes name the variants.
    named = [
        axes.get_title("left").split()[0]
        for axes in figure.subfigs[0].axes
        if [label.get_text() for label in axes.get_yticklabels()] == ["a", "b", "c"]
    ]
    assert named == ["mean", "finished"]
