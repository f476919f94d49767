"""One sampler, one colour, wherever it is drawn."""

import re
from pathlib import Path

import numpy as np
import pytest
from campaign_cases import row
from matplotlib.colors import to_hex
from test_report import run

from quadsim.campaign.flights import figure as comparison
from quadsim.campaign.flights.stats import Section, variant_stats
from quadsim.course import load_course
from quadsim.figures.run_figure import draw
from quadsim.palette import OTHER, SPARE, STYLES, dotted, style, styles, styles_on_dark
from quadsim.paper import double_integrator

ROOT = Path(__file__).parents[2]


def test_a_sampler_has_its_own_style_and_other_variants_the_spare_ones_in_order():
    found = styles(["soft", "gaussian", "wild", "colored"])
    assert found == [SPARE[0], STYLES["gaussian"], SPARE[1], STYLES["colored"]]


def test_many_variants_differ_in_colour_or_dashes():
    """Nine variants had six styles, the last three of them twice."""
    found = styles([f"variant {k}" for k in range(len(SPARE) ** 2)])
    assert found[: len(SPARE)] == list(SPARE)
    assert len(set(found)) == len(found) == 36
    assert not set(found) & set(STYLES.values())


def test_no_two_styles_of_the_palette_have_one_colour():
    colours = [s.colour for s in (*STYLES.values(), *SPARE, OTHER)]
    assert len(set(colours)) == len(colours)


def test_eight_competitors_differ_in_colour_and_line_also_with_one_sampler():
    for samplers in (["colored"] * 8, ["gaussian", "colored"] * 4, [*STYLES, "pilot", *STYLES][:8]):
        found = styles_on_dark(samplers)
        assert len({s.colour for s in found}) == len(found)
        assert len({s.dash for s in found[-7:]}) >= 5
        assert found[0] == STYLES[samplers[0]]


def test_a_sampler_s_second_line_keeps_its_colour_and_differs_from_the_first():
    for s in STYLES.values():
        assert dotted(s).colour == s.colour
        assert dotted(s).dash != s.dash


def bars(names):
    """Colour of each variant's success bar in a comparison."""
    rows = [[row(seed, folder="nowhere") for seed in range(2)] for _ in names]
    variants = [
        variant_stats(name, of_variant, 20.0) for name, of_variant in zip(names, rows, strict=True)
    ]
    section = Section(load_course("paper_flat"), "", 20.0, variants, [], rows, ROOT)
    success = comparison.draw([section]).subfigs[0].axes[2]
    return dict(
        zip(names, (to_hex(patch.get_facecolor()) for patch in success.patches), strict=True)
    )


def test_a_variant_of_a_comparison_has_its_sampler_s_colour_in_any_place():
    for names in (["gaussian", "colored"], ["colored", "soft", "gaussian"]):
        found = bars(names)
        assert found["gaussian"] == style("gaussian").colour
        assert found["colored"] == style("colored").colour
    assert found["soft"] == SPARE[0].colour


@pytest.mark.slow
def test_the_picture_of_a_run_draws_what_was_commanded_in_its_sampler_s_colour():
    flown = run()
    for sampler in ("colored", "gaussian"):
        flown.spec["sampler"] = sampler
        figure = draw(flown)
        lines = [
            x
            for axes in figure.findobj(lambda a: hasattr(a, "get_lines"))
            for x in axes.get_lines()
        ]
        found = {to_hex(x.get_color()) for x in lines if x.get_label() == "commanded"}
        assert found == {style(sampler).colour}


def test_the_paper_s_best_runs_are_drawn_in_their_samplers_colours():
    t = np.linspace(0.0, 4.5, 301)
    track = double_integrator.Track(t=t, p=np.zeros(301), u=t)
    figure = double_integrator.draw(dict.fromkeys(double_integrator.LOOKS, track))
    found = {x.get_label(): to_hex(x.get_color()) for x in figure.axes[0].get_lines()}
    for name in double_integrator.LOOKS:
        assert found[name] == style(re.sub(r"_\d$", "", name)).colour
