"""Claims about a race behind a page, without any page."""

import json
from dataclasses import replace

import numpy as np
from web_cases import PERIOD, Gliders, choices, until

from quadsim.record.archive import list_runs, load_run
from quadsim.record.limits import limit_of
from web.competitor import stored_competitor
from web.race import Race
from web.session import Session


def fast(session):
    """As fast as it goes."""
    session.tell(Race.set_speed, 1e6)


def over(session):
    return until(lambda: session.snapshot.competitors and not session.snapshot.flying)


def test_a_flight_is_kept_and_the_page_shows_its_laps(session, tmp_path):
    fast(session)
    session.tell(Race.start, [choices(laps=3)])
    assert over(session)
    (folder,) = list_runs(tmp_path)
    stored = json.loads((folder / "run.json").read_text())
    assert list(session.snapshot.competitors[0].laps) == stored["laps"]
    assert len(stored["laps"]) == 3
    assert session.snapshot.competitors[0].folder == folder
    best = limit_of(stored["spec"]).time
    assert (
        session.snapshot.competitors[0].limit.time == stored_competitor(folder).limit.time == best
    )


def test_two_samplers_fly_turn_by_turn(session):
    session.tell(Race.set_speed, 20.0)
    session.tell(Race.start, [choices("colored", laps=3), choices("gaussian", laps=3)])
    apart = []

    def ended():
        competitors = session.snapshot.competitors
        if len(competitors) == 2 and all(
            entry.outcome is None and len(entry.t) for entry in competitors
        ):
            apart.append(abs(competitors[0].t[-1] - competitors[1].t[-1]))
        return competitors and not session.snapshot.flying

    assert until(ended)
    assert max(apart) <= PERIOD + 1e-9


def test_a_change_in_flight_is_on_the_record_and_marks_the_run(session, flight_factory, tmp_path):
    session.tell(Race.start, [choices(laps=2)])
    assert until(
        lambda: session.snapshot.competitors and len(session.snapshot.competitors[0].t) > 5
    )
    session.tell(Race.tune, "gamma_rates", 1.0)
    fast(session)
    assert over(session)
    (change,) = load_run(list_runs(tmp_path)[0]).spec["interactive"]
    assert (change["name"], change["from"], change["to"]) == ("gamma_rates", 2.0, 1.0)
    assert 0.0 < change["t"] < session.snapshot.end
    assert flight_factory.built[0].numbers["gamma_rates"] == 1.0


def test_an_untouched_flight_is_not_marked(session, flight_factory, tmp_path):
    fast(session)
    session.tell(Race.start, [choices()])
    # unchanged
    session.tell(Race.tune, "samples", flight_factory.numbers("race", "colored")["samples"])
    assert over(session)
    assert "interactive" not in load_run(list_runs(tmp_path)[0]).spec


def test_planner_snapshots_can_be_replayed_as_soon_as_the_flight_has_ended(session, tmp_path):
    fast(session)
    session.tell(Race.start, [choices(laps=2)])
    assert over(session)
    landed = session.snapshot.competitors[0]
    stored = stored_competitor(list_runs(tmp_path)[0])
    assert landed.live
    for i in (0, 25, len(landed.t) - 1):
        (now, mine), (then, kept) = landed.snapshot(i), stored.snapshot(i)
        assert (now, mine.terms) == (then, kept.terms)
        assert np.array_equal(mine.best, kept.best)


def test_pausing_stops_the_flight_and_a_step_flies_one_period(session):
    session.tell(Race.start, [choices(laps=3)])
    session.tell(Race.play, False)
    assert until(lambda: session.snapshot.race == 1 and not session.snapshot.playing)
    frames = len(session.snapshot.competitors[0].t)
    session.tell(Race.step)
    assert until(lambda: len(session.snapshot.competitors[0].t) == frames + 1)


def test_a_paced_flight_does_not_outrun_the_clock(session):
    session.tell(Race.start, [choices(laps=3)])
    assert until(lambda: session.snapshot.t > 0.3)
    assert session.snapshot.factor < 1.3


def test_restart_while_flying_ends_the_old_flight_and_begins_anew(session, flight_factory):
    session.tell(Race.start, [choices(laps=3)])
    assert until(lambda: session.snapshot.t > 0.05)
    session.tell(Race.restart)
    assert until(lambda: session.snapshot.race == 2)
    assert flight_factory.built[0].closed
    assert until(lambda: len(session.snapshot.competitors[0].t) > 2)
    assert not flight_factory.built[1].closed


def test_a_replay_shows_the_time_it_is_scrubbed_to(session, tmp_path):
    fast(session)
    session.tell(Race.start, [choices(laps=2)])
    assert over(session)
    session.tell(Race.start, [], list_runs(tmp_path))
    session.tell(Race.play, False)
    session.tell(Race.scrub, 0.5)
    assert until(lambda: session.snapshot.t == 0.5)
    competitor = session.snapshot.competitors[0]
    assert competitor.t[competitor.at(0.5)] == 0.5
    session.tell(Race.jump)
    following = min(e.t for e in competitor.events if e.t > 0.5)
    assert until(lambda: session.snapshot.t == following)


def test_a_replay_ignores_the_sliders(session, flight_factory, tmp_path):
    fast(session)
    session.tell(Race.start, [choices()])
    assert over(session)
    session.tell(Race.start, [], list_runs(tmp_path))
    session.tell(Race.tune, "samples", 512)
    assert until(lambda: session.snapshot.race == 2)
    assert flight_factory.built[0].numbers["samples"] != 512


def test_choices_that_cannot_be_flown_are_a_notice_and_the_race_goes_on(session):
    session.tell(Race.start, [choices(laps=3)])
    session.tell(Race.start, [choices(laps=99)])
    assert until(lambda: any(n.kind == "error" for n in session.snapshot.notices))
    assert session.snapshot.race == 1
    assert session.snapshot.flying


def test_runs_of_different_courses_are_not_shown_side_by_side(session, tmp_path):
    fast(session)
    session.tell(Race.start, [choices()])
    assert over(session)
    session.tell(Race.start, [replace(choices(), course="paper_flat")], list_runs(tmp_path))
    assert until(lambda: any("one course" in n.text for n in session.snapshot.notices))


def test_closing_leaves_no_thread_and_no_half_written_run(tmp_path):
    session = Session(Gliders(), str(tmp_path))
    session.tell(Race.start, [choices(laps=40)])
    assert until(lambda: session.snapshot.t > 0.0)
    session.close()
    assert not session._worker.is_alive()
    assert not list(tmp_path.glob("*.part"))


def test_a_closed_flight_that_has_passed_a_gate_is_kept_as_interrupted(tmp_path):
    session = Session(Gliders(), str(tmp_path))
    session.tell(Race.start, [choices(laps=40)])
    assert until(lambda: session.snapshot.competitors and session.snapshot.competitors[0].events)
    session.close()
    (folder,) = list_runs(tmp_path)
    assert load_run(folder).outcome == "interrupted"


def test_snapshots_only_ever_grow(session):
    """A view taken early is not changed by what is flown later."""
    session.tell(Race.start, [choices(laps=30)])
    assert until(
        lambda: session.snapshot.competitors and len(session.snapshot.competitors[0].t) > 3
    )
    early = session.snapshot.competitors[0]
    before = early.x["px"].copy()
    fast(session)
    # the table has grown by then
    assert until(lambda: len(session.snapshot.competitors[0].t) > 1500)
    assert np.array_equal(before, early.x["px"])


def test_a_flight_that_must_compile_first_says_so_and_another_does_not(session, flight_factory):
    fast(session)
    session.tell(Race.start, [choices()])
    assert over(session)
    assert not any(n.kind == "wait" for n in session.snapshot.notices)
    flight = flight_factory.flight

    def cold(c):
        glider = flight(c)
        glider.is_cached = False
        return glider

    flight_factory.flight = cold
    session.tell(Race.restart)
    assert until(lambda: any(n.kind == "wait" for n in session.snapshot.notices))
