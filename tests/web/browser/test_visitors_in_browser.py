"""Claims about a page that several visitors share, and about its playback."""

import pytest
from browser_cases import (
    HELD,
    button,
    press,
    waited,
)
from wire import link

from quadsim.web.race.page_race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]


PRESSED = """() => {
    const button = document.querySelector("[data-act=start]");
    button.click();
    return [button.textContent, document.querySelector(".sentence").textContent] }"""


def test_a_press_of_start_is_answered_before_the_server_does_anything(page, session):
    race = session.snapshot.race
    assert page.evaluate(PRESSED) == ["starting", "START: sent to the server"]
    assert waited(page, lambda: session.snapshot.race > race)
    assert waited(page, lambda: button(page, "START").count() == 1)


def test_who_would_end_the_flight_of_another_visitor_is_asked_first(page, session):
    with link(session.server.get_port()) as other:
        other.send("start")
        assert waited(page, lambda: session.snapshot.flying and session.snapshot.t > 0.1)
        session.tell(PageRace.set_speed, HELD)
        race = session.snapshot.race
        press(page, "START")
        page.get_by_role("button", name="Let it fly").click()
        assert session.snapshot.race == race
        assert session.snapshot.flying
        assert waited(page, lambda: button(page, "Let it fly").count() == 0)
        page.keyboard.press("x")
        page.get_by_role("button", name="End it").click()
        assert waited(page, lambda: not session.snapshot.flying)
        # the visitor whose flight it is is not asked
        other.send("list_runs")
        assert "question" not in other.types_until("runs")
