"""Claims about the end of stored flights: one finishes, one crashes, both between two frames."""

import pytest
from browser_cases import DRAWN, group, head, opened, press, type_time, waited
from web_cases import crashed_run, store, stored

from quadsim.web.race.page_race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]


@pytest.fixture(scope="module")
def runs(root):
    return {"finished": stored(root, "colored", laps=3), "crashed": store(root, crashed_run())}


def shown(page):
    """Return the sentence of the head and the rows of the tower."""
    marks = page.locator(".tower [data-mark]").evaluate_all("all => all.map(e => e.dataset.mark)")
    return head(page), page.locator(".tower tbody").inner_text(), marks


def line(page):
    return page.get_by_role("slider", name="Time of the race")


def near_the_end(page, before):
    """Watch a time shortly before the end [s]."""
    type_time(page, f"{float(line(page).get_attribute('aria-valuemax')) - before:.2f}")


def played(page):
    before = line(page).get_attribute("aria-valuenow")
    near_the_end(page, 0.6)
    assert waited(page, lambda: line(page).get_attribute("aria-valuenow") != before)
    press(page, "play")


def by_events(page):
    near_the_end(page, 1.0)
    button = page.get_by_role("button", name="Next event")
    while button.is_enabled():
        before = line(page).get_attribute("aria-valuenow")
        button.click()
        assert waited(page, lambda b=before: line(page).get_attribute("aria-valuenow") != b)


def dragged(page):
    box = line(page).bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] / 2, y)
    page.mouse.down()
    page.mouse.move(int(box["x"] + box["width"]), y, steps=4)
    page.mouse.up()


WAYS = {
    "key End": lambda page: line(page).press("End"),
    "typed": lambda page: type_time(page, 99),
    "typed as it reads": lambda page: type_time(page, line(page).get_attribute("aria-valuemax")),
    "dragged": dragged,
    "events": by_events,
}


@pytest.fixture(scope="module")
def colleague(browser, shared_session):
    """The page of another visitor, who opens links."""
    with opened(browser, shared_session.address) as page:
        yield page


@pytest.mark.parametrize("names", [["crashed"], ["crashed", "finished"]])
def test_every_way_to_the_end_shows_the_same_result(page, session, runs, names, colleague):
    session.tell(PageRace.start, [], [runs[name] for name in names])
    assert waited(page, lambda: "replay" in page.locator(".head").inner_text())
    played(page)
    assert waited(page, lambda: "ended" in page.locator(".head").inner_text())
    wanted = shown(page)
    assert len(names) > 1 or names[0].upper() in wanted[0]
    for name, way in WAYS.items():
        type_time(page, 0.5)
        assert waited(page, lambda: shown(page) != wanted), name
        way(page)
        assert waited(page, lambda: shown(page) == wanted, 20), (name, shown(page), wanted)
    group(page, "Export")
    press(page, "link")
    address = page.locator("dialog code").inner_text()
    press(page, "Close")
    colleague.goto(address.replace("/?", f"/{DRAWN}&"))
    assert waited(colleague, lambda: shown(colleague) == wanted), (shown(colleague), wanted)
