"""Claims that the page can be used by its names and keys, and says when it is cut off, over flights
without physics."""

import pytest
from browser_cases import (
    drawer,
    press,
    scene,
    waited,
)

from quadsim.web.race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]

UNNAMED = """() => [...document.querySelectorAll(
    "input:not([type=hidden]), textarea, button, canvas, [role=slider], [role=button]")]
    .filter(e => e.offsetParent && e.ariaHidden !== "true" && !e.labels?.length)
    .filter(e => !e.getAttribute("aria-label")?.trim() && !e.innerText?.trim())
    .map(e => e.outerHTML.slice(0, 200))"""


@pytest.fixture(autouse=True)
def nothing_has_the_focus(page):
    page.evaluate("document.activeElement.blur()")


OUTLINE = "getComputedStyle(document.activeElement).outlineStyle"
FOCUSED = """() => document.activeElement.innerText
    || document.activeElement.getAttribute('aria-label') || ''"""


def focused(page):
    """The name of what has the focus, in the page or in the frame of the scene."""
    inside = page.evaluate("document.activeElement.tagName") == "IFRAME"
    return (scene(page) if inside else page).evaluate(FOCUSED)


def tab_to(page, name):
    for _ in range(160):
        if focused(page).strip() == name:
            return True
        page.keyboard.press("Tab")
    return False


def test_every_control_that_can_be_seen_has_a_name(page):
    assert page.title() == "race"
    inside = drawer(page)
    inside.get_by_text("Export", exact=True).click()
    for part in (page, inside):
        assert waited(page, lambda part=part: part.evaluate(UNNAMED) == []), part.evaluate(UNNAMED)
    assert inside.get_by_label("Samples", exact=True).count() >= 1
    inside.get_by_text("Export", exact=True).click()


def test_after_a_click_on_start_the_space_bar_pauses(page, session):
    race = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race == race + 1 and session.snapshot.t > 0.1)
    page.keyboard.press("Space")
    assert waited(page, lambda: not session.snapshot.playing)
    t = session.snapshot.t
    page.keyboard.press("b")  # a key that acts after it
    assert waited(page, lambda: session.snapshot.t < t)
    assert session.snapshot.flying
    assert session.snapshot.race == race + 1


def test_what_tab_comes_to_is_seen_and_acts_by_space_or_enter_alone(page, session):
    assert tab_to(page, "START")
    assert page.evaluate(OUTLINE) == "solid"
    race = session.snapshot.race
    page.keyboard.press("Space")
    assert waited(page, lambda: session.snapshot.race == race + 1 and session.snapshot.t > 0.1)
    assert session.snapshot.playing  # and not paused by the same key
    session.tell(PageRace.end_flights)
    folder = drawer(page).get_by_role("button", name="Export", exact=True)
    opened = folder.get_attribute("aria-expanded")
    page.locator("[data-act=settings]").focus()
    assert tab_to(page, "Export")
    assert scene(page).evaluate(OUTLINE) == "solid"
    page.keyboard.press("Enter")
    assert waited(page, lambda: folder.get_attribute("aria-expanded") != opened)
    page.keyboard.press("Enter")
    assert waited(page, lambda: folder.get_attribute("aria-expanded") == opened)


def test_a_lost_connection_is_lost_in_words_until_it_is_back(page, session):
    before = len(page.complaints)
    lost = page.get_by_role("status").filter(has_text="Disconnected")
    assert lost.count() == 0
    page.context.set_offline(True)  # keeps it from coming back
    session.server._websock_server.disconnect_all_clients()
    lost.first.wait_for()
    assert "disconnected" in page.title()
    page.context.set_offline(False)
    assert waited(page, lambda: lost.count() == 0 and page.title() == "race", 30)
    # What the browser reports while it is offline is no fault of the page.
    del page.complaints[before:]
