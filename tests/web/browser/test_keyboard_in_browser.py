"""Claims that the page can be used by its names and keys, over flights without physics."""

import pytest
from browser_cases import (
    group,
    is_playing,
    press,
    shown_time,
    waited,
)

from quadsim.web.race.page_race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]

UNNAMED = """() => [...document.querySelectorAll(
    "input, select, textarea, button, iframe, summary, [role=slider], [role=button]")]
    .filter(e => e.offsetParent && e.ariaHidden !== "true" && !e.labels?.length)
    .filter(e => !e.getAttribute("aria-label")?.trim() && !e.innerText?.trim() && !e.title)
    .map(e => e.outerHTML.slice(0, 200))"""


@pytest.fixture(autouse=True)
def nothing_has_the_focus(page):
    page.evaluate("document.activeElement.blur()")


OUTLINE = "getComputedStyle(document.activeElement).outlineStyle"
FOCUSED = """() => document.activeElement.innerText
    || document.activeElement.getAttribute('aria-label') || ''"""


def focused(page):
    """The name of what has the focus."""
    return page.evaluate(FOCUSED)


def tab_to(page, name):
    for _ in range(160):
        if focused(page).strip() == name:
            return True
        page.keyboard.press("Tab")
    return False


STANDS = 1000  # [ms] until the time that a paused page shows is the one at which it paused


def test_every_control_that_can_be_seen_has_a_name(page):
    assert page.title() == "race"
    for title in ("All numbers", "MPPI", "View", "Export", "Course editor"):
        group(page, title)
    assert waited(page, lambda: page.evaluate(UNNAMED) == []), page.evaluate(UNNAMED)
    samples = page.get_by_label("Samples", exact=True)
    assert samples.count() == 2  # its box and its slider
    assert samples.first.get_attribute("aria-describedby")


def test_the_space_bar_pauses_after_a_click_and_presses_what_tab_comes_to(page, session):
    pauses_after_a_click_on_start(page, session)
    session.tell(PageRace.end_flights)
    page.evaluate("document.activeElement.blur()")
    acts_where_tab_comes_to(page, session)


def pauses_after_a_click_on_start(page, session):
    race = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race == race + 1 and session.snapshot.t > 0.1)
    page.keyboard.press("Space")
    assert waited(page, lambda: not is_playing(page))
    page.wait_for_timeout(STANDS)
    t = shown_time(page)
    page.keyboard.press("b")  # a key that acts after it
    assert waited(page, lambda: shown_time(page) < t)
    assert session.snapshot.flying
    assert session.snapshot.race == race + 1


def acts_where_tab_comes_to(page, session):
    """It is seen, and acts by space or Enter alone."""
    assert tab_to(page, "START")
    assert page.evaluate(OUTLINE) == "solid"
    race = session.snapshot.race
    page.keyboard.press("Space")
    assert waited(page, lambda: session.snapshot.race == race + 1 and session.snapshot.t > 0.1)
    assert waited(page, lambda: is_playing(page))  # and not paused by the same key
    session.tell(PageRace.end_flights)
    page.locator("[data-act=settings]").focus()
    folder = group(page, "Export")
    assert tab_to(page, "Export")
    assert page.evaluate(OUTLINE) == "solid"
    page.keyboard.press("Enter")
    assert waited(page, lambda: folder.get_attribute("open") is None)
