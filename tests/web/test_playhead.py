"""Claims about the time that each visitor watches, without any page."""

from dataclasses import replace

import pytest
from web_cases import PERIOD, choices, competitor

from quadsim.web.race.playhead import jump, live, play, seek, step, watched, with_speed
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.state.commands import MOST_LEFT, ComeBack, Leave, SetPlayhead, SetView, apply
from quadsim.web.state.page_state import PageState, Playhead
from quadsim.web.state.view import View

NOW = 100.0  # on the wall clock [s]
A, B = 1, 2  # visitors


@pytest.fixture(scope="module")
def whole():
    return competitor(laps=2)


def flight(whole, t):
    """The race at t [s] of a flight that is on."""
    flying = replace(whole.until(t), live=True)
    flown = flying.last_t
    return Snapshot(
        t=flown,
        end=flown,
        flown=flown,
        playing=True,
        flying=True,
        competitors=(flying,),
        race=1,
        began=NOW,
    )


def landed(whole):
    return replace(flight(whole, 99.0), flying=False, playing=False)


def replay(whole):
    end = whole.last_t
    return Snapshot(end=end, flown=end, competitors=(whole,), race=1, began=NOW)


def test_a_flight_is_watched_live_until_a_visitor_looks_elsewhere(whole):
    early, late = flight(whole, 0.5), flight(whole, 1.0)
    head = Playhead()
    assert watched(head, early, NOW) is early
    paused = play(head, early, NOW, on=False)
    seen = watched(paused, late, NOW + 0.5)
    assert (seen.t, seen.playing, seen.is_live) == (early.t, False, False)
    assert (seen.flying, seen.flown) == (True, late.t)  # the flight goes on
    assert watched(live(paused, late), late, NOW + 0.5) is late
    # continued, it stays as far behind
    seen = watched(play(paused, late, NOW + 0.5), late, NOW + 0.7)
    assert seen.t == pytest.approx(early.t + 0.2)
    assert seen.playing


def test_a_slow_visitor_falls_behind_a_flight_and_a_fast_one_catches_up(whole):
    begun = flight(whole, 0.2)
    slow = with_speed(Playhead(), begun, NOW, 0.5)
    later = flight(whole, 1.2)
    seen = watched(slow, later, NOW + 1.0)
    assert (seen.t, seen.speed) == (pytest.approx(0.7), 0.5)
    fast = with_speed(slow, later, NOW + 1.0, 4.0)
    assert watched(fast, later, NOW + 1.1).t == pytest.approx(1.1)
    assert watched(fast, later, NOW + 1.2) is later
    # who watches live cannot be ahead of the flight
    assert watched(with_speed(Playhead(), begun, NOW, 4.0), later, NOW + 0.1) is later


def test_another_race_is_watched_from_its_own_beginning(whole):
    stored, flown = replay(whole), flight(whole, 0.5)
    sought = seek(Playhead(), flown, NOW, 0.1)
    for head in (Playhead(), sought):
        assert watched(head, replace(flown, race=2), NOW + 1.0).is_live
        seen = watched(head, replace(stored, race=2), NOW + 0.25)
        assert (seen.t, seen.playing, seen.is_live) == (pytest.approx(0.25), True, False)
    # who comes late sees a replay from its start, too
    assert watched(Playhead(at=NOW + 60.0), stored, NOW + 60.3).t == pytest.approx(0.3)


def test_a_race_that_has_ended_is_each_visitors_own_replay(whole):
    s = landed(whole)
    seen = watched(Playhead(race=1), s, NOW)
    assert (seen.t, seen.playing) == (whole.last_t, False)
    again = play(Playhead(race=1), s, NOW)
    assert watched(again, s, NOW + 0.3).t == pytest.approx(0.3)
    over = watched(again, s, NOW + 99.0)
    assert (over.t, over.playing) == (whole.last_t, False)
    assert watched(play(again, s, NOW + 99.0), s, NOW + 99.1).t == pytest.approx(0.1)


def test_steps_and_events_move_by_frames_and_pause(whole):
    s = replay(whole)
    head = seek(Playhead(), s, NOW, 0.5)
    for by in (1, -1):
        seen = watched(step(head, s, NOW, by), s, NOW + 9.0)
        assert (seen.t, seen.playing) == (pytest.approx(0.5 + by * PERIOD), False)
    following = min(event.t for event in whole.events if event.t > 0.5)
    assert watched(jump(head, s, NOW), s, NOW).t == following
    last = seek(head, s, NOW, 99.0)
    assert watched(last, s, NOW).t == whole.last_t
    assert jump(last, s, NOW) is last
    assert watched(step(last, s, NOW, 1), s, NOW).t == whole.last_t


def test_what_a_visitor_watches_is_that_visitors_alone(whole):
    s = flight(whole, 0.5)
    before = PageState.of(choices())
    state = apply(before, SetPlayhead(A, seek(Playhead(), s, NOW, 0.2)))
    state = apply(state, SetView(A, "ghosts", "by place"))
    assert state.visitor(A).view.by_place
    assert watched(state.visitor(A).playhead, s, NOW).t == 0.2
    assert state.visitor(B) == before.visitor(B)
    assert watched(state.visitor(B).playhead, s, NOW) is s
    assert state.start == before.start


def test_who_comes_back_to_its_seat_watches_what_it_watched(whole):
    s = flight(whole, 0.5)
    state = PageState.of(choices())
    for command in (
        SetPlayhead(A, seek(Playhead(), s, NOW, 0.2)),
        SetView(A, "light", True),
        Leave(A, "seat of A"),
        ComeBack(B, "another seat"),
    ):
        state = apply(state, command)
    assert A not in state.visitors
    assert state.visitor(B).view == View()
    state = apply(state, ComeBack(B, "seat of A"))
    assert state.visitor(B).view.light
    assert watched(state.visitor(B).playhead, s, NOW).t == 0.2
    for k in range(2 * MOST_LEFT):
        state = apply(apply(state, SetView(k + 3, "light", True)), Leave(k + 3, f"seat {k}"))
    assert len(state.left) == MOST_LEFT
