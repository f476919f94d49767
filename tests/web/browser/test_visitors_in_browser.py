"""Claims about a page that several visitors share, and about its playback, over flights without
physics."""

import pytest
from browser_cases import SLOW, choose, dashboard, fill, press, waited
from web_cases import COURSE, PERIOD, Gliders, choices

from quadsim.record.archive import list_runs
from web.race import Race


@pytest.fixture(scope="module")
def session(root):
    with dashboard(root, Gliders(), course=COURSE, laps=40) as session:
        yield session


@pytest.fixture(scope="module")
def other(browser, session):
    """Another visitor's page."""
    page = browser.new_page(viewport={"width": 1200, "height": 800})
    page.set_default_timeout(SLOW)
    page.goto(session.address)
    page.get_by_role("button", name="START", exact=True).wait_for()
    yield page
    page.close()


@pytest.fixture(autouse=True)
def ended(session):
    yield
    session.tell(Race.end_flights)


def button(page, name):
    return page.get_by_role("button", name=name, exact=True)


def start(page, session, still=False):
    """still: paused at once. The flight is on, but two pages need not draw it in software while
    they are clicked."""
    races = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race > races and session.snapshot.t > 0.1, 20)
    if still:
        session.tell(Race.play, False)
        assert waited(page, lambda: not session.snapshot.playing)


def test_stop_ends_a_flight_and_keeps_it(page, session, root):
    assert button(page, "STOP").is_disabled()
    start(page, session)
    assert waited(
        page, lambda: any(e.kind == "pass" for e in session.snapshot.competitors[0].events)
    )
    press(page, "STOP")
    assert waited(page, lambda: not session.snapshot.flying)
    assert len(list_runs(root)) == 1
    assert waited(page, lambda: button(page, "STOP").is_disabled())


def test_pause_reads_play_and_a_paused_flight_can_be_looked_back_at(page, session):
    start(page, session)
    assert waited(page, lambda: button(page, "Next event").is_disabled())  # none has been flown yet
    assert waited(
        page, lambda: any(e.kind == "pass" for e in session.snapshot.competitors[0].events)
    )
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
    session.tell(Race.scrub, 0.0)
    assert waited(page, lambda: button(page, "Next event").is_enabled())
    press(page, "Next event")
    gate = session.snapshot.competitors[0].events[0].t
    assert waited(page, lambda: session.snapshot.t == pytest.approx(gate))
    press(page, "play")
    assert waited(page, lambda: session.snapshot.t > flown)
    assert waited(page, lambda: len(session.snapshot.competitors[0].t) > frames)


def test_another_visitors_start_asks_before_it_ends_a_flight(page, other, session):
    start(page, session, still=True)
    race = session.snapshot.race
    press(other, "START")
    button(other, "Let it fly").click()
    assert session.snapshot.race == race
    assert session.snapshot.flying
    assert button(page, "Let it fly").count() == 0  # whose flight it is is not asked
    other.keyboard.press("x")
    button(other, "End it").click()
    assert waited(other, lambda: not session.snapshot.flying, 20)
    start(page, session, still=True)
    page.reload()  # and is still the same visitor
    button(page, "START").wait_for()
    start(page, session)


def test_the_first_visitor_may_leave_the_others_only_watching(page, other, session):
    page.get_by_text("Visitors", exact=True).click()
    page.get_by_label("Others only watch").check()
    page.wait_for_timeout(500)
    races = session.snapshot.race
    press(other, "START")
    other.get_by_text("You are watching").first.wait_for()
    other.keyboard.press("s")
    fill(other, "Seed", 7)
    other.wait_for_timeout(500)
    assert session.snapshot.race == races
    start(page, session, still=True)  # the first visitor flies on
    assert session.snapshot.competitors[0].spec["seed"] == 0
    page.get_by_label("Others only watch").uncheck()
    page.wait_for_timeout(500)
    press(other, "START")
    button(other, "End it").click()
    assert waited(other, lambda: session.snapshot.race == races + 2, 20)


def test_a_stored_run_beside_a_flight_does_not_move_the_time_ahead(page, session, root):
    session.tell(Race.start, [choices("gaussian", laps=40)], list_runs(root)[:1])
    assert waited(page, lambda: session.snapshot.t > 0.1, 20)
    press(page, "pause")
    button(page, "play").wait_for()
    flown, frames = session.snapshot.t, len(session.snapshot.competitors[0].t)
    press(page, ">")
    assert waited(page, lambda: session.snapshot.t == pytest.approx(flown + PERIOD))
    assert len(session.snapshot.competitors[0].t) == frames + 1
    choose(page, "Mode", "live")
