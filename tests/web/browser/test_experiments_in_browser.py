"""Claims that what the page's sliders say is what is flown, and that what is flown is what is
recorded."""

import pytest
from browser_cases import choose, field, fill, press, waited

from controllers.presets import PRESETS
from quadsim.record.archive import list_runs
from web.race import Race

COLORED, GAUSSIAN = (PRESETS["race"][sampler] for sampler in ("colored", "gaussian"))


def shown(page, label):
    return float(field(page, label).last.input_value())


def changes(session):
    """Of every competitor, without their times."""
    return [
        [(c["name"], c["from"], c["to"]) for c in e.changes] for e in session.snapshot.competitors
    ]


def planners(session):
    return [e.spec["planner"] for e in session.snapshot.competitors]


def start(page, session, *modes):
    for label, option in modes:
        choose(page, label, option)
    races = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race > races and session.snapshot.t > 0.05, 120)


@pytest.fixture(autouse=True)
def ended(session):
    yield
    session.tell(Race.end_flights)


def test_moved_before_the_start_a_slider_reaches_both_samplers(page, session):
    choose(page, "Sampler", "colored")
    fill(page, "Samples", 512)
    fill(page, "Sigma scale", 1.5)
    start(page, session, ("Mode", "live: two samplers"))
    assert [p["mppi"]["samples"] for p in planners(session)] == [512, 512]
    for planner, preset in zip(planners(session), (COLORED, GAUSSIAN), strict=True):
        assert list(planner["sampling"]["sigma"]) == pytest.approx(
            [1.5 * s for s in preset.sampling.sigma]
        )
        assert planner["mppi"]["target_ess"] == preset.mppi.target_ess


def test_a_slider_moved_in_flight_changes_that_number_alone_from_each_ones_own(page, session):
    start(page, session, ("Mode", "live: two samplers"))
    fill(page, "Samples", 256)
    assert waited(page, lambda: all(changes(session)))
    fill(page, "Target ESS", 20)
    assert waited(page, lambda: all(len(c) == 2 for c in changes(session)))
    assert changes(session) == [
        [("samples", 512, 256), ("target_ess", preset.mppi.target_ess, 20)]
        for preset in (COLORED, GAUSSIAN)
    ]


def test_a_sampler_chosen_for_the_next_race_does_not_reach_the_running_flight(page, session):
    start(page, session, ("Mode", "live"))
    choose(page, "Sampler", "gaussian")
    page.wait_for_timeout(500)
    assert (
        shown(page, "Target ESS")
        == session.snapshot.competitors[0].spec["planner"]["mppi"]["target_ess"]
    )
    fill(page, "Samples", 768)
    assert waited(page, lambda: changes(session)[0])
    assert [name for name, _, _ in changes(session)[0]] == ["samples"]
    choose(page, "Sampler", "colored")


def test_after_a_restart_the_sliders_show_what_flies(page, session):
    start(page, session)
    before = planners(session)[0]["mppi"]["samples"]
    fill(page, "Samples", 1024)
    assert waited(page, lambda: changes(session)[0])
    press(page, "Restart")
    assert waited(
        page,
        lambda: (
            session.snapshot.competitors and not changes(session)[0] and session.snapshot.t > 0.05
        ),
    )
    assert planners(session)[0]["mppi"]["samples"] == before
    assert waited(page, lambda: shown(page, "Samples") == before, 10)


def test_a_replay_shows_the_runs_numbers_and_a_later_flight_has_those_of_the_boxes(
    page, session, root
):
    choose(page, "Sampler", "colored")
    fill(page, "Samples", 512)
    fill(page, "Temperature", 2.5)
    before = set(list_runs(root))
    start(page, session)
    assert waited(
        page, lambda: any(e.kind == "pass" for e in session.snapshot.competitors[0].events)
    )
    session.tell(Race.end_flights)
    assert waited(page, lambda: set(list_runs(root)) - before)
    fill(page, "Samples", 1024)  # of the next flight
    choose(page, "Mode", "replay")
    (folder,) = set(list_runs(root)) - before
    choose(page, "Run", {path: title for title, path in session.titled_runs(9).items()}[folder])
    press(page, "REPLAY")
    assert waited(page, lambda: not session.snapshot.competitors[0].live)
    assert waited(
        page, lambda: (shown(page, "Samples"), shown(page, "Temperature")) == (512, 2.5), 10
    )
    choose(page, "Mode", "live")
    assert waited(page, lambda: shown(page, "Samples") == 1024, 10)
    fill(page, "Samples", 256)
    start(page, session)
    assert planners(session)[0]["mppi"]["samples"] == 256
