"""What seeds draw is said below a comparison whose flights are not randomized."""

import pytest

import quadsim
from quadsim.campaign.run.seeds import seeds_remark

FIX = "so intervals are narrow: --randomize 1 also draws start, vehicle and gusts."


class Climb:
    def control(self, x):
        return 0.0, 0.0, 0.0, 11.0


@pytest.mark.parametrize(
    ("settings", "drawn"),
    [
        ({}, "the planner's noise alone"),
        ({"sensing": "mocap"}, "the planner's noise and the sensors' noise alone"),
        (
            {"sensing": "gates", "displace_gates": 0.1, "fault": "rotor1=.5", "link_loss": 0.1},
            "the planner's noise, the sensors' noise, the places of gates, the faults and lost"
            " frames alone",
        ),
        ({"controller": Climb()}, "what your own controller draws alone"),
        ({"pilot": "split_s_swift"}, "nothing"),
    ],
)
def test_the_remark_names_what_seeds_differ_in(settings, drawn):
    spec = quadsim.Spec.of("split_s_swift", **settings)
    assert seeds_remark([spec]) == f"Seeds differ in {drawn}, {FIX}"
    assert seeds_remark([spec.but(randomize=1.0)]) == ""
    assert seeds_remark([spec, spec.but(randomize=1.0)]) == seeds_remark([spec])
    assert "\n" not in seeds_remark([spec])


@pytest.mark.parametrize("randomize", [0.0, 1.0])
def test_a_comparison_says_it_once_in_text_markdown_and_html(randomize):
    variants = {"a": {"controller": Climb()}, "b": {"controller": Climb()}}
    short = {"laps": 1, "timeout": 0.05, "randomize": randomize}
    found = quadsim.compare("figure8", variants, attempts=2, **short)
    for text in (str(found), found.document().markdown("x.png"), found._repr_html_()):
        assert " ".join(text.split()).count("so intervals are narrow") == (randomize == 0.0)


def test_a_comparison_of_races_says_it_too():
    entrants = {"a": {"controller": Climb()}, "b": {"controller": Climb()}}
    for starts, drawn in ((1, "draws alone"), (2, "draws and the places on the grid alone")):
        found = quadsim.compare_heats(entrants, "figure8", starts=starts, laps=1, timeout=0.05)
        assert f"{drawn}, so intervals are narrow" in " ".join(str(found).split())
