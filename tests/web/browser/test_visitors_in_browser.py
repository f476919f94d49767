"""Claims about a page that several visitors share, and about its playback."""

import pytest
from browser_cases import button, choose, press, waited
from web_cases import PERIOD, choices, stored
from wire import connect

from quadsim.record.archive import list_runs
from web.race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]


def start(page, session):
    races = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race > races and session.snapshot.t > 0.1)


def test_stop_ends_a_flight_and_keeps_it(page, session, root):
    assert waited(page, lambda: button(page, "STOP").is_disabled())
    runs = len(list_runs(root))
    start(page, session)
    assert waited(page, lambda: session.snapshot.competitors[0].events)
    press(page, "STOP")
    assert waited(page, lambda: not session.snapshot.flying)
    assert len(list_runs(root)) == runs + 1
    assert waited(page, lambda: button(page, "STOP").is_disabled())


def test_pause_reads_play_and_a_paused_flight_can_be_looked_back_at(page, session):
    start(page, session)
    assert waited(page, lambda: session.snapshot.competitors[0].events)
    assert button(page, "Next event").is_disabled()  # what is next has not been flown yet
    press(page, "pause")
    button(page, "play").wait_for()
    flown = session.snapshot.t
    for k in (1, 2):
        press(page, "<")
        assert waited(page, lambda k=k: session.snapshot.t == pytest.approx(flown - k * PERIOD))
    frames = len(session.snapshot.competitors[0].t)
    press(page, ">")
    assert waited(page, lambda: session.snapshot.t == pytest.approx(flown - PERIOD))
    assert len(session.snapshot.competitors[0].t) == frames  # nothing was flown for it
    session.tell(PageRace.scrub, 0.0)
    assert waited(page, lambda: button(page, "Next event").is_enabled())
    press(page, "Next event")
    gate = session.snapshot.competitors[0].events[0].t
    assert waited(page, lambda: session.snapshot.t == pytest.approx(gate))
    press(page, "play")
    assert waited(page, lambda: session.snapshot.t > flown)
    assert waited(page, lambda: len(session.snapshot.competitors[0].t) > frames)


def test_a_stored_run_beside_a_flight_does_not_move_the_time_ahead(page, session, root):
    run = stored(root, "colored", laps=3)
    session.tell(PageRace.start, [choices("gaussian", laps=40)], [run])
    assert waited(page, lambda: session.snapshot.flying and session.snapshot.t > 0.1)
    press(page, "pause")
    button(page, "play").wait_for()
    flown = session.snapshot.t
    frames = len(session.snapshot.competitors[0].t)
    press(page, ">")
    assert waited(page, lambda: session.snapshot.t == pytest.approx(flown + PERIOD))
    assert len(session.snapshot.competitors[0].t) == frames + 1
    choose(page, "Mode", "live")


def test_who_would_end_the_flight_of_another_visitor_is_asked_first(page, session):
    with connect(session.server.get_port()) as other:
        other.act(*other.controls("START"))
        assert waited(page, lambda: session.snapshot.flying and session.snapshot.t > 0.1)
        session.tell(PageRace.play, False)
        race = session.snapshot.race
        press(page, "START")
        button(page, "Let it fly").click()
        assert session.snapshot.race == race
        assert session.snapshot.flying
        assert waited(page, lambda: button(page, "Let it fly").count() == 0)
        page.keyboard.press("x")
        button(page, "End it").click()
        assert waited(page, lambda: not session.snapshot.flying)
        # the visitor whose flight it is is not asked
        assert "GuiModalMessage" not in [message["type"] for message in other.waiting()]
