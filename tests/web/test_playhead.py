"""Claims about the time that each visitor watches, without any page."""

from dataclasses import replace
from pathlib import Path
from urllib.parse import parse_qs

import pytest
from web_cases import PERIOD, choices, competitor, crashed_run

from quadsim.web.page.forms.runs_panel import link_to
from quadsim.web.page.parts.head import Head, head_of
from quadsim.web.page.parts.time_line import now_of
from quadsim.web.page.parts.tower import tower_of
from quadsim.web.race.lap_timing import lap_timings
from quadsim.web.race.playhead import jump, live, play, seek, step, watched, with_speed
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.stored_competitor import run_competitor
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


def replay(*entries):
    end = max(entry.last_t for entry in entries)
    return Snapshot(end=end, flown=end, competitors=entries, race=1, began=NOW)


def crashed(whole, share=0.8):
    return run_competitor(crashed_run(share=share), whole.course, None)


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
    last = seek(head, s, NOW, 99.0)
    assert watched(last, s, NOW).t == whole.last_t
    assert jump(last, s, NOW) is last
    assert watched(step(last, s, NOW, 1), s, NOW).t == whole.last_t


def test_the_next_event_is_seen_at_the_time_of_the_jump(whole):
    """An event lies between two frames: at its own time the frame before it is seen."""
    ways = (replay(whole), replay(crashed(whole)), replay(whole, crashed(whole)))
    for s in ways:
        head, seen = seek(Playhead(), s, NOW, 0.0), []
        while watched(head, s, NOW).next_event is not None:
            head = jump(head, s, NOW)
            now = watched(head, s, NOW)
            assert all(now.t - PERIOD < one.t <= now.t for one in _shown(now) - set(seen))
            assert len(_shown(now)) > len(seen)
            seen = _shown(now)
        assert len(seen) == sum(len(entry.events) for entry in s.competitors)
        assert lap_timings(watched(head, s, NOW))[-1].over


def _shown(s):
    """The events whose frame is shown."""
    frames = [(entry, float(entry.t[entry.at(s.t)])) for entry in s.competitors]
    return {event for entry, t in frames for event in entry.events_until(t)}


def test_a_step_moves_by_one_frame_and_never_the_other_way(whole):
    """Also beyond the end of the first competitor, and between two frames."""
    s = replay(crashed(whole, share=0.3), whole)
    first, last = (entry.last_t for entry in s.competitors)
    for t in (0.0, 0.123, first, first + 0.5, first + 0.5004, last - 0.001, last):
        head = seek(Playhead(), s, NOW, t)
        before, after = (watched(step(head, s, NOW, by), s, NOW).t for by in (-1, 1))
        assert t - PERIOD - 1e-9 <= before < t or t == before == 0.0
        assert t < after <= t + PERIOD + 1e-9 or t == after == last


def test_every_way_to_the_end_shows_the_same_result():
    whole = competitor(laps=3)
    crash = crashed(whole)
    assert whole.last_t == pytest.approx(5.4475)  # between two frames, and between two milliseconds
    for entries in ((whole,), (crash,), (crash, whole), (whole, crash)):
        s = replay(*entries)
        played = watched(play(Playhead(), s, NOW, on=True), s, NOW + 99.0)
        beyond = seek(Playhead(), s, NOW, 99.0)
        to_end = seek(Playhead(), s, NOW, now_of(played).end)
        by_events = seek(Playhead(), s, NOW, 0.0)
        while now_of(watched(by_events, s, NOW)).has_next:
            by_events = jump(by_events, s, NOW)
        root = Path("/runs")
        named = [replace(entry, folder=root / "run") for entry in entries]
        link = parse_qs(link_to(named, played.t, "free", View(), str(root)).removeprefix("?"))
        linked = seek(Playhead(), s, NOW, float(link["t"][0]))
        for head in (beyond, to_end, by_events, linked):
            seen = watched(head, s, NOW)
            assert seen.t == played.t
            assert tower_of(lap_timings(seen)) == tower_of(lap_timings(played))
            assert _head(seen) == _head(played)


def _head(s):
    return head_of(s, lap_timings(s), Head("rest", []))


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
