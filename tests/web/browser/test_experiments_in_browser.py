"""Claims that what the page's sliders say is what is flown, and what is flown is recorded.

The flights are without physics; that the planner itself takes a number over is claimed in
test_flights_in_browser.
"""

import pytest
from browser_cases import choose, field, fill, press, waited

from controllers.presets import PRESETS
from quadsim.record.archive import list_runs
from web.race import PageRace
from web.stored_runs import titled_runs

PRESET = PRESETS["race"]
SAMPLERS = ("colored", "gaussian")


def shown(page, label):
    return float(field(page, label).last.input_value())


def changes(session):
    """Of every competitor, without their times."""
    competitors = session.snapshot.competitors
    return [[(c["name"], c["from"], c["to"]) for c in entry.changes] for entry in competitors]


def planners(session):
    return [entry.spec["planner"] for entry in session.snapshot.competitors]


def start(page, session):
    races = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race > races and session.snapshot.t > 0.05)


@pytest.fixture(autouse=True)
def preset(page):
    """The sliders show the preset before each test."""
    choose(page, "Sampler", "colored")
    press(page, "Reset to preset")
    assert waited(page, lambda: shown(page, "Samples") == PRESET["colored"].mppi.samples)
    yield
    choose(page, "Mode", "live")


def test_moved_before_the_start_a_slider_reaches_both_samplers(page, session):
    fill(page, "Samples", 512)
    fill(page, "Sigma scale", 1.5)
    choose(page, "Mode", "live: two samplers")
    start(page, session)
    for name, planner in zip(SAMPLERS, planners(session), strict=True):
        wanted = [1.5 * sigma for sigma in PRESET[name].sampling.sigma]
        assert list(planner["sampling"]["sigma"]) == pytest.approx(wanted)
        assert planner["mppi"]["samples"] == 512
        assert planner["mppi"]["target_ess"] == PRESET[name].mppi.target_ess


def test_a_slider_moved_in_flight_changes_that_number_alone_from_each_ones_own(page, session):
    choose(page, "Mode", "live: two samplers")
    start(page, session)
    fill(page, "Samples", 256)
    assert waited(page, lambda: all(changes(session)))
    fill(page, "Target ESS", 20)
    assert waited(page, lambda: all(len(c) == 2 for c in changes(session)))
    for name, changed in zip(SAMPLERS, changes(session), strict=True):
        mppi = PRESET[name].mppi
        wanted = [("samples", mppi.samples, 256), ("target_ess", mppi.target_ess, 20)]
        assert changed == wanted


def test_a_sampler_chosen_for_the_next_race_does_not_reach_the_running_flight(page, session):
    start(page, session)
    choose(page, "Sampler", "gaussian")
    fill(page, "Samples", 768)
    assert waited(page, lambda: changes(session)[0])
    assert [name for name, _, _ in changes(session)[0]] == ["samples"]
    assert shown(page, "Target ESS") == PRESET["colored"].mppi.target_ess


def test_after_a_restart_the_sliders_show_what_flies(page, session):
    start(page, session)
    before = planners(session)[0]["mppi"]["samples"]
    fill(page, "Samples", 1024)
    assert waited(page, lambda: changes(session)[0])
    races = session.snapshot.race
    press(page, "Restart")
    assert waited(page, lambda: session.snapshot.race > races and session.snapshot.t > 0.05)
    assert planners(session)[0]["mppi"]["samples"] == before
    assert changes(session) == [[]]
    assert waited(page, lambda: shown(page, "Samples") == before)


def test_a_slider_of_a_paused_flight_stays_where_it_was_put(page, session):
    start(page, session)
    session.tell(PageRace.play, False)
    assert waited(page, lambda: not session.snapshot.playing)
    fill(page, "Samples", 1024)
    (flight,) = session.snapshot.competitors
    assert waited(page, lambda: session.snapshot.competitors[0].pending_numbers)
    page.wait_for_timeout(800)  # longer than a slider keeps what was set by hand
    assert shown(page, "Samples") == 1024
    assert flight.changes == []


def test_a_replay_shows_the_runs_numbers_and_a_later_flight_has_those_of_the_boxes(
    page, session, root
):
    fill(page, "Samples", 512)
    fill(page, "Temperature", 2.5)
    before = set(list_runs(root))
    start(page, session)
    assert waited(page, lambda: session.snapshot.competitors[0].events)
    session.tell(PageRace.end_flights)
    assert waited(page, lambda: set(list_runs(root)) - before)
    fill(page, "Samples", 1024)  # of the next flight
    choose(page, "Mode", "replay")
    (folder,) = set(list_runs(root)) - before
    titles = {path: title for title, path in titled_runs(str(root), 200).items()}
    choose(page, "Run", titles[folder])
    press(page, "REPLAY")
    assert waited(page, lambda: not session.snapshot.competitors[0].live)
    assert waited(page, lambda: shown(page, "Samples") == 512)
    assert waited(page, lambda: shown(page, "Temperature") == 2.5)
    choose(page, "Mode", "live")
    assert waited(page, lambda: shown(page, "Samples") == 1024)
    fill(page, "Samples", 256)
    start(page, session)
    assert planners(session)[0]["mppi"]["samples"] == 256
