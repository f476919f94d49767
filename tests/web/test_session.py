"""Claims about a race behind a page, without any page."""

import json
from dataclasses import replace
from math import inf
from threading import Event

import numpy as np
import pytest
from web_cases import COURSE, PERIOD, Clock, Glider, Gliders, choices, stored, until

from quadsim.controllers.presets import preset
from quadsim.files.values import checked
from quadsim.limit.limits import limit_of
from quadsim.record.archive import list_runs, read_run
from quadsim.web.race.pace import Pace
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.session import Session
from quadsim.web.race.snapshot import Preparing
from quadsim.web.race.stored_competitor import stored_competitor
from quadsim.web.state.choices import Choices, planner_kinds
from quadsim.web.state.numbers import SLIDERS, Change, with_change


@pytest.fixture
def session(gliders, tmp_path):
    session = Session(str(tmp_path), gliders)
    yield session
    session.close()


def fast(session):
    """As fast as it goes."""
    session.tell(PageRace.set_speed, 1e6)


def over(session):
    return until(lambda: session.snapshot.competitors and not session.snapshot.flying)


def flown(session, frames):
    """Return whether the first competitor comes to have more frames."""
    return until(
        lambda: session.snapshot.competitors and len(session.snapshot.competitors[0].t) > frames
    )


def test_each_step_of_a_start_is_told_once(session):
    """A page shows it at once, and frames as they come do not hurry it."""
    seen = []
    session.steps = lambda: seen.append(session.snapshot)
    fast(session)
    session.tell(PageRace.start, [choices(laps=3)])
    assert over(session)
    steps = [(s.preparing and s.preparing.what, s.race, s.is_taking_off, s.t > 0) for s in seen]
    assert steps == [
        ("building", 0, False, False),
        (None, 1, True, False),
        (None, 1, False, False),
        (None, 1, False, True),
    ]


def test_a_flight_is_kept_and_the_page_shows_its_laps(session, tmp_path):
    fast(session)
    session.tell(PageRace.start, [choices(laps=3)])
    assert over(session)
    (folder,) = list_runs(tmp_path)
    stored = json.loads((folder / "run.json").read_text())
    (landed,) = session.snapshot.competitors
    assert list(landed.laps) == stored["laps"]
    assert len(stored["laps"]) == 3
    assert landed.folder == folder
    best = limit_of(stored["spec"]).time
    assert landed.limit.time == stored_competitor(folder).limit.time == best


def test_two_samplers_fly_turn_by_turn(gliders, tmp_path):
    race = PageRace(str(tmp_path), gliders)
    race.set_speed(1e6)
    race.start([choices("colored"), choices("gaussian")])
    first, second = gliders.built
    while not (first.is_over or second.is_over):
        race.turn()
        assert abs(first.t - second.t) <= PERIOD + 1e-9
    assert race.snapshot().flying


def test_a_change_in_flight_is_on_the_record_and_marks_the_run(session, gliders, tmp_path):
    session.tell(PageRace.start, [choices(laps=2)])
    assert flown(session, 5)
    session.tell(PageRace.change, Change("gamma_rates", 1.0))
    fast(session)
    assert over(session)
    (change,) = read_run(list_runs(tmp_path)[0]).spec["interactive"]
    assert (change["name"], change["from"], change["to"]) == ("gamma_rates", 0.8, 1.0)
    assert change["t"] in session.snapshot.competitors[0].t[5:-1]
    assert gliders.built[0].now.numbers(inf)["gamma_rates"] == 1.0


def test_an_untouched_flight_is_not_marked(session, tmp_path):
    fast(session)
    session.tell(PageRace.start, [choices()])
    session.tell(PageRace.change, Change("samples", None))  # unchanged
    assert over(session)
    assert read_run(list_runs(tmp_path)[0]).spec["interactive"] == []


def changed(glider, *changes):
    for name, value in changes:
        glider.change(Change(name, value))


def noted(glider):
    return [(c.t, c.name, c.before, c.after) for c in glider.now.changes]


def test_only_numbers_that_a_plan_has_used_are_on_the_record():
    """Several changes before a plan are one, at the time of the plan that uses it."""
    glider = Glider(choices())
    glider.advance()
    changed(glider, ("sigma", 2.0), ("sigma", 1.0))
    glider.advance()
    assert noted(glider) == []
    changed(glider, ("gamma_thrust", 3.0), ("gamma_thrust", 4.0), ("samples", 512))
    assert glider.now.numbers(0.0)["gamma_thrust"] == 4.0  # the slider shows what is asked for
    glider.advance()
    t = glider.t
    assert noted(glider) == [(t, "gamma_thrust", 2.0, 4.0), (t, "samples", 1024, 512)]
    changed(glider, ("temperature", 3.0))
    glider.end()
    assert len(noted(glider)) == 2  # no plan has used it


def test_none_is_the_number_of_the_preset():
    glider = Glider(choices(numbers={"samples": 512}))
    changed(glider, ("samples", None), ("target_ess", 0.0))
    glider.advance()
    assert noted(glider) == [(0.0, "target_ess", 20, 0.0), (0.0, "samples", 512, 1024)]


def test_a_number_that_a_sampler_lacks_changes_nothing():
    glider = Glider(choices("gaussian"))
    changed(glider, ("gamma_rates", 3.0))
    glider.advance()
    assert noted(glider) == []


@pytest.mark.parametrize("name", SLIDERS)
def test_a_slider_stays_within_the_range_of_its_setting(name):
    slider = SLIDERS[name]
    kind = planner_kinds("race", "colored")[slider.setting]
    of_preset = preset("race", "colored")
    for value in (slider.low, slider.high):
        planner = with_change(of_preset, of_preset, Change(name, value))
        number = {**vars(planner.sampling), **vars(planner.mppi)}[slider.setting]
        assert checked(slider.setting, number, kind) == number


def test_planner_snapshots_can_be_replayed_as_soon_as_the_flight_has_ended(session, tmp_path):
    fast(session)
    session.tell(PageRace.start, [choices(laps=2)])
    assert over(session)
    landed = session.snapshot.competitors[0]
    stored = stored_competitor(list_runs(tmp_path)[0])
    assert landed.live
    for i in (0, 25, len(landed.t) - 1):
        (now, mine), (then, kept) = landed.snapshot(i), stored.snapshot(i)
        assert (now, mine.terms) == (then, kept.terms)
        assert np.array_equal(mine.best, kept.best)


def test_a_flight_neither_outruns_the_clock_nor_falls_behind_it(gliders, tmp_path, monkeypatch):
    clock = Clock()
    monkeypatch.setattr("quadsim.web.race.page_race.Pace", lambda: Pace(clock))
    race = PageRace(str(tmp_path), gliders)
    race.set_speed(0.5)
    race.start([choices()])
    for _ in range(20):
        clock.now += 0.02
        while race.turn() == 0.0:
            pass
        due = 0.5 * (clock.now - Clock.began)
        assert due - PERIOD - 1e-9 <= race.snapshot().t <= due + 1e-9
    assert race.snapshot().factor == pytest.approx(0.5, abs=0.05)


def test_a_session_flies_with_physics_unless_it_is_given_other_flights(tmp_path):
    """By hand, as a planner would be compiled."""
    session = Session(str(tmp_path))
    session.tell(PageRace.start, [Choices(course=COURSE, sampler="hand")])
    assert until(lambda: session.snapshot.waiting and len(session.snapshot.competitors[0].t))
    session.close()
    assert session.snapshot.competitors[0].x["vx"][0] == 0.0  # a glider has its speed at once


def test_restart_while_flying_ends_the_old_flight_and_begins_anew(session, gliders):
    session.tell(PageRace.start, [choices(laps=3)])
    assert flown(session, 5)
    session.tell(PageRace.restart)
    assert until(lambda: session.snapshot.race == 2)
    assert gliders.built[0].closed
    assert flown(session, 2)
    assert not gliders.built[1].closed


def test_a_replay_ignores_the_sliders(session, gliders, tmp_path):
    fast(session)
    session.tell(PageRace.start, [choices()])
    assert over(session)
    session.tell(PageRace.start, [], list_runs(tmp_path))
    session.tell(PageRace.change, Change("samples", 512))
    assert until(lambda: session.snapshot.race == 2)
    assert gliders.built[0].now.numbers(inf)["samples"] == 1024


def test_choices_that_cannot_be_flown_are_a_notice_and_the_race_goes_on(session):
    session.tell(PageRace.start, [choices(laps=3)])
    session.tell(PageRace.start, [choices(laps=10**6)])
    assert until(lambda: any(n.kind == "error" for n in session.snapshot.notices))
    assert session.snapshot.race == 1
    assert session.snapshot.flying


def test_runs_of_different_courses_are_not_shown_side_by_side(session, gliders, tmp_path):
    fast(session)
    session.tell(PageRace.start, [choices()])
    assert over(session)
    session.tell(PageRace.start, [replace(choices(), course="paper_flat")], list_runs(tmp_path))
    assert until(lambda: any(n.kind == "error" for n in session.snapshot.notices))
    assert session.snapshot.race == 1
    assert gliders.built[1].closed


def test_closing_leaves_no_thread_and_no_half_written_run(tmp_path):
    session = Session(str(tmp_path), Gliders())
    session.tell(PageRace.start, [choices(laps=40)])
    assert until(lambda: session.snapshot.t > 0.0)
    session.close()
    assert not session._worker.is_alive()
    assert not list(tmp_path.glob("*.part"))


def test_a_closed_flight_that_has_passed_a_gate_is_kept_as_interrupted(tmp_path):
    session = Session(str(tmp_path), Gliders())
    session.tell(PageRace.start, [choices(laps=40)])
    assert until(lambda: session.snapshot.competitors and session.snapshot.competitors[0].events)
    session.close()
    (folder,) = list_runs(tmp_path)
    assert read_run(folder).outcome == "interrupted"


def test_snapshots_only_ever_grow(session):
    """A view taken early is not changed by what is flown later."""
    session.tell(PageRace.start, [choices(laps=30)])
    assert flown(session, 3)
    early = session.snapshot.competitors[0]
    before = early.x["px"].copy()
    fast(session)
    assert flown(session, 1500)  # the table has grown by then
    assert np.array_equal(before, early.x["px"])


def test_a_flight_that_must_compile_first_says_so_and_another_does_not(session, gliders):
    fast(session)
    session.tell(PageRace.start, [choices()])
    assert over(session)
    assert session.snapshot.preparing is None
    gliders.compiled = Event()
    session.tell(PageRace.restart)
    assert until(lambda: session.snapshot.preparing == Preparing("compiling", 1, 1))
    gliders.compiled.set()
    assert until(lambda: not session.snapshot.preparing)


def test_the_same_start_again_is_dropped_until_its_first_plan_is_ready(session, gliders):
    """An impatient second click would begin anew."""
    gliders.compiled = Event()
    first = session.start([choices(laps=3)])
    assert until(lambda: session.snapshot.is_taking_off)
    assert session.start([choices(laps=3)]) is first
    second = session.start([choices(laps=2)])
    assert second is not first  # another one is meant
    assert session.start([choices(laps=2)]) is second
    gliders.compiled.set()
    assert until(lambda: session.snapshot.race == 2 and session.snapshot.t > 0.0)
    assert [glider.flown.laps for glider in gliders.built] == [3, 2]
    assert (first.race, second.race) == (1, 2)
    # While it flies, it begins anew.
    third = session.start([choices(laps=2)])
    assert until(lambda: third.race == session.snapshot.race == 3)


def test_the_same_start_after_stop_is_meant(session, gliders):
    gliders.compiled = Event()
    first = session.start([choices(laps=3)])
    assert until(lambda: session.snapshot.is_taking_off)
    session.tell(PageRace.end_flights)
    second = session.start([choices(laps=3)])
    gliders.compiled.set()
    assert until(lambda: second.race == session.snapshot.race == 2 and session.snapshot.t > 0.0)
    assert first.race == 1


def test_a_start_that_was_refused_can_be_asked_again(session):
    def refused():
        """Return how many starts were refused so far."""
        return sum(notice.kind == "error" for notice in session.snapshot.notices)

    for count in (1, 2):
        start = session.start([choices(laps=10**6)])
        assert until(lambda count=count: refused() == count)
        assert start.race == 0


def test_a_stored_run_beside_a_flight_does_not_move_the_time_ahead(gliders, tmp_path):
    run = stored(tmp_path, "colored", laps=3)
    race = PageRace(str(tmp_path), gliders)
    race.set_speed(1e6)
    race.start([choices("gaussian", laps=3)], [run])
    for _ in range(20):
        race.turn()
        s = race.snapshot()
        assert s.t == s.flown == s.competitors[0].last_t < s.end
