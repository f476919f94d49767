"""Claims about the time that each visitor watches, without any page."""

from dataclasses import replace

import pytest
from web_cases import PERIOD, choices, competitor

from quadsim.web.commands import MOST_LEFT, ComeBack, Leave, SetPlayhead, SetView, apply
from quadsim.web.playhead import Playhead
from quadsim.web.snapshot import Snapshot
from quadsim.web.state import PageState
from quadsim.web.view import View

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
    assert head.watched(early, NOW) is early
    paused = head.play(early, NOW, on=False)
    seen = paused.watched(late, NOW + 0.5)
    assert (seen.t, seen.playing, seen.is_live) == (early.t, False, False)
    assert (seen.flying, seen.flown) == (True, late.t)  # the flight goes on
    assert paused.live(late).watched(late, NOW + 0.5) is late
    # continued, it stays as far behind
    seen = paused.play(late, NOW + 0.5).watched(late, NOW + 0.7)
    assert seen.t == pytest.approx(early.t + 0.2)
    assert seen.playing


def test_a_slow_visitor_falls_behind_a_flight_and_a_fast_one_catches_up(whole):
    begun = flight(whole, 0.2)
    slow = Playhead().with_speed(begun, NOW, 0.5)
    later = flight(whole, 1.2)
    seen = slow.watched(later, NOW + 1.0)
    assert (seen.t, seen.speed) == (pytest.approx(0.7), 0.5)
    fast = slow.with_speed(later, NOW + 1.0, 4.0)
    assert fast.watched(later, NOW + 1.1).t == pytest.approx(1.1)
    assert fast.watched(later, NOW + 1.2) is later
    # who watches live cannot be ahead of the flight
    assert Playhead().with_speed(begun, NOW, 4.0).watched(later, NOW + 0.1) is later


def test_another_race_is_watched_from_its_own_beginning(whole):
    stored, flown = replay(whole), flight(whole, 0.5)
    sought = Playhead().seek(flown, NOW, 0.1)
    for head in (Playhead(), sought):
        assert head.watched(replace(flown, race=2), NOW + 1.0).is_live
        seen = head.watched(replace(stored, race=2), NOW + 0.25)
        assert (seen.t, seen.playing, seen.is_live) == (pytest.approx(0.25), True, False)
    # who comes late sees a replay from its start, too
    assert Playhead(at=NOW + 60.0).watched(stored, NOW + 60.3).t == pytest.approx(0.3)


def test_a_race_that_has_ended_is_each_visitors_own_replay(whole):
    s = landed(whole)
    watched = Playhead(race=1).watched(s, NOW)
    assert (watched.t, watched.playing) == (whole.last_t, False)
    again = Playhead(race=1).play(s, NOW)
    assert again.watched(s, NOW + 0.3).t == pytest.approx(0.3)
    over = again.watched(s, NOW + 99.0)
    assert (over.t, over.playing) == (whole.last_t, False)
    assert again.play(s, NOW + 99.0).watched(s, NOW + 99.1).t == pytest.approx(0.1)


def test_steps_and_events_move_by_frames_and_pause(whole):
    s = replay(whole)
    head = Playhead().seek(s, NOW, 0.5)
    for by in (1, -1):
        seen = head.step(s, NOW, by).watched(s, NOW + 9.0)
        assert (seen.t, seen.playing) == (pytest.approx(0.5 + by * PERIOD), False)
    following = min(event.t for event in whole.events if event.t > 0.5)
    assert head.jump(s, NOW).watched(s, NOW).t == following
    last = head.seek(s, NOW, 99.0)
    assert last.watched(s, NOW).t == whole.last_t
    assert last.jump(s, NOW) is last
    assert last.step(s, NOW, 1).watched(s, NOW).t == whole.last_t


def test_what_a_visitor_watches_is_that_visitors_alone(whole):
    s = flight(whole, 0.5)
    before = PageState.of(choices())
    state = apply(before, SetPlayhead(A, Playhead().seek(s, NOW, 0.2)))
    state = apply(state, SetView(A, "ghosts", "by place"))
    assert state.visitor(A).view.by_place
    assert state.visitor(A).playhead.watched(s, NOW).t == 0.2
    assert state.visitor(B) == before.visitor(B)
    assert state.visitor(B).playhead.watched(s, NOW) is s
    assert state.start == before.start


def test_who_comes_back_to_its_seat_watches_what_it_watched(whole):
    s = flight(whole, 0.5)
    state = PageState.of(choices())
    for command in (
        SetPlayhead(A, Playhead().seek(s, NOW, 0.2)),
        SetView(A, "light", True),
        Leave(A, "seat of A"),
        ComeBack(B, "another seat"),
    ):
        state = apply(state, command)
    assert A not in state.visitors
    assert state.visitor(B).view == View()
    state = apply(state, ComeBack(B, "seat of A"))
    assert state.visitor(B).view.light
    assert state.visitor(B).playhead.watched(s, NOW).t == 0.2
    for k in range(2 * MOST_LEFT):
        state = apply(apply(state, SetView(k + 3, "light", True)), Leave(k + 3, f"seat {k}"))
    assert len(state.left) == MOST_LEFT
