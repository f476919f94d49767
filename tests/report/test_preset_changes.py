"""A run names the numbers of its planner that differ from those of its preset."""

import json

from quadsim.config.spec import Spec
from quadsim.controllers.presets import PRESETS
from quadsim.report.preset_changes import preset_changes
from quadsim.report.run_text import flown_with


def recorded(**settings):
    """Return the record of a flight as a file has it."""
    return json.loads(json.dumps(Spec.of("figure8", **settings).record()))


def test_a_planner_with_the_numbers_of_its_preset_has_no_changes():
    for preset in PRESETS.keys() - {"race_informed"}:
        for sampler in PRESETS["race"]:
            changes = preset_changes(recorded(preset=preset, sampler=sampler))
            assert changes == "", (preset, sampler)


def test_changed_numbers_are_named_in_the_line_that_says_what_flew():
    record = recorded(samples=256, gamma=(1, 1, 1, 2), adapt=False, sensing="mocap")
    changes = "gamma 1 1 1 2, samples 256, adapt false"
    assert preset_changes(record) == changes
    assert flown_with(record).endswith(f"seed 0, sensing mocap, {changes}")


def test_at_most_four_numbers_are_named():
    record = recorded(samples=256, horizon=90, iterations=1, tighten=0.2, margin=0.2, crash=500)
    assert preset_changes(record).endswith("tighten 0.2, and 2 more")


def test_a_preset_of_another_version_and_a_sampler_of_ones_own_have_none():
    assert preset_changes(recorded() | {"preset": "old"}) == ""
    assert preset_changes({"preset": "race", "sampler": "HaltonSpline"}) == ""


class White:
    """A sampler of one's own."""

    def sample(self, rng, samples, horizon, controls):
        return rng.normal(size=(samples, horizon, controls))


def test_a_sampler_of_ones_own_shows_what_differs_from_the_preset_that_it_flies_with():
    assert preset_changes(recorded(sampler=White())) == ""
    changed = preset_changes(recorded(sampler=White(), samples=512, margin=0.45))
    assert changed == "samples 512, margin 0.45"
