"""Claims about the numbers of flights that are shown: of several, and under a deadline."""

from dataclasses import replace

import msgspec
import pytest
from web_cases import Glider, choices, competitor

from quadsim.controllers.presets import PRESETS
from quadsim.record.schema import FlownAmong, Rules
from quadsim.web.page.parts.elements import to_html
from quadsim.web.page.parts.timing import planner
from quadsim.web.race.competitor import named
from quadsim.web.race.lap_timing import lap_timings
from quadsim.web.race.numbers_in_flight import (
    can_change,
    drawn_samples,
    has_number,
    late_plans,
    numbers_of_several,
    remark,
)
from quadsim.web.race.snapshot import Snapshot

USUAL = PRESETS["race"]["gaussian"].mppi
MOST = PRESETS["race"]["colored"].mppi.samples
FEWER = 300  # samples, which no preset has


@pytest.fixture(scope="module")
def two():
    cold = competitor("colored", numbers={"temperature": 0.2, "samples": FEWER})
    return named([cold, competitor("gaussian")])


def test_numbers_that_differ_are_named_with_the_value_of_each(two):
    """No number of one competitor is everyone's."""
    found = {one.name: one for one in numbers_of_several(two, 0.0)}
    assert found["temperature"].values == (0.2, USUAL.temperature)
    assert found["samples"].values == (FEWER, USUAL.samples)
    assert not found["sigma"].differs
    # of colored sampling alone
    assert not found["gamma_rates"].differs
    said = remark(two, 0.0)
    assert "They differ: " in said
    assert f"temperature 0.2 / {USUAL.temperature:g}" in said
    assert "sigma" not in said
    assert "differ" not in remark(two[:1], 0.0)


def test_a_change_in_flight_counts_from_its_time(two):
    change = {"t": 0.1, "name": "samples", "from": FEWER, "to": 500}
    changed = two[0].with_record({**two[0].record, "interactive": [change]})
    at = {t: {one.name: one for one in numbers_of_several([changed], t)} for t in (0.05, 0.2)}
    assert at[0.05]["samples"].values == (FEWER,)
    assert at[0.2]["samples"].values == (500,)


def test_gaussian_sampling_has_no_gamma_and_a_stored_run_cannot_be_changed(two):
    colored, gaussian = two
    assert has_number(colored, "gamma_thrust")
    assert not has_number(gaussian, "gamma_thrust")
    assert has_number(gaussian, "sigma")
    assert not can_change(colored, "sigma")
    flying = replace(colored, live=True, outcome=None)
    assert can_change(flying, "sigma")
    heat = FlownAmong("one", ["one", "two"], 1, Rules("physics"), "0")
    in_one_world = flying.with_record({**flying.record, "heat": msgspec.to_builtins(heat)})
    assert not can_change(in_one_world, "sigma")


def test_under_a_deadline_the_number_drawn_is_shown_and_not_the_setting():
    entry = competitor("colored", deadline_ms="5")
    last = len(entry.t) - 1
    live = replace(entry, live=True, outcome=None, drawn_samples=384)
    assert drawn_samples(live, last).count == 384
    assert drawn_samples(live, last).words == f"384 samples, of {MOST} by the deadline of 5 ms"
    # Of an earlier plan, and of a stored run, the number is not known.
    for flight, i in ((live, 3), (entry, last)):
        assert drawn_samples(flight, i).count is None
        assert "how many is not recorded" in drawn_samples(flight, i).words
    assert drawn_samples(competitor("colored"), 3).words == f"{MOST} samples"


def test_plans_that_took_longer_than_the_deadline_are_counted():
    entry = competitor("colored", deadline_ms="5")
    took = entry.x["plan_ms"].copy()
    took[[2, 4, 7]] = 6.0
    late = replace(entry, x={**entry.x, "plan_ms": took})
    assert late_plans(late, 4) == "2 of 5 plans took longer than the deadline of 5 ms"
    assert late_plans(competitor("colored"), 4) == ""


def test_a_live_flight_knows_the_samples_of_its_last_plan(monkeypatch):
    glider = Glider(choices(deadline_ms="5"))
    drawn = iter([512, 256, 128])
    monkeypatch.setattr(glider, "_samples_to_draw", lambda: next(drawn))
    for count in (512, 256):
        glider.advance()
        assert glider.now.drawn_samples == count


def test_the_table_of_the_planner_says_whose_it_is_and_what_it_has_drawn(two):
    entry = named([competitor("colored", deadline_ms="5"), two[1]])[0]
    s = Snapshot(t=0.5, end=9.0, competitors=(entry,))
    (timing,) = lap_timings(s)
    page = to_html(planner(timing))
    assert "colored" in page
    assert f"at most {MOST} samples" in page
    assert "of 51 plans took longer" in page
