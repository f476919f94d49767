"""Claims about what is seen, in a real browser, of two stored flights: one finishes, one hits a
gate."""

import io

import numpy as np
import pytest
from browser_cases import (
    SLOW,
    group,
    head,
    press,
    scene,
    type_time,
    waited,
)
from matplotlib.image import imread
from web_cases import crashed_run, store, stored
from wire import connect

from quadsim.palette import STYLES
from quadsim.web.race.page_race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]

PALE = (226, 209, 73)  # how an orange of (230, 159, 0) looks where it is sent as it is
# how many texts there are, and those with less contrast to their ground (WCAG 2.1, 1.4.3: inactive
# controls are exempt)
CONTRAST = """least => {
  const light = c => c.map(v => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, k) => sum + v * [0.2126, 0.7152, 0.0722][k], 0);
  const parsed = s => {
    const n = s.match(/[\\d.]+/g).map(Number);
    return n.length > 3 ? n : [...n, 1];
  };
  const over = (a, b) => [0, 1, 2].map(k => a[k] * a[3] + b[k] * (1 - a[3]));
  const poor = [], texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  let count = 0;
  while (texts.nextNode()) {
    const e = texts.currentNode.parentElement, words = texts.currentNode.textContent.trim();
    const drawn = e.checkVisibility({opacityProperty: true, visibilityProperty: true});
    const live = !e.closest("style, script, :disabled, [data-disabled]");
    if (!words || !drawn || !live || !e.getBoundingClientRect().width) continue;
    const grounds = [];
    let opacity = 1, ground = [20, 20, 20];
    for (let n = e; n; n = n.parentElement) {
      grounds.unshift(parsed(getComputedStyle(n).backgroundColor));
      opacity *= getComputedStyle(n).opacity;
    }
    for (const g of grounds) ground = over(g, ground);
    const ink = parsed(getComputedStyle(e)[e.namespaceURI.includes("svg") ? "fill" : "color"]);
    const drawnInk = over([...ink.slice(0, 3), ink[3] * opacity], ground);
    const pair = [light(drawnInk), light(ground)].sort((a, b) => b - a);
    count += 1;
    if ((pair[0] + 0.05) / (pair[1] + 0.05) < least) poor.push(words);
  }
  return [count, poor];
}"""


@pytest.fixture(scope="module")
def runs(root):
    """The folder of a race whose limit is known, and of one that ends at a gate."""
    return [stored(root, "colored", laps=3), store(root, crashed_run())]


@pytest.fixture
def race(session, runs, page):
    """The session on a replay of both at its end."""
    session.tell(PageRace.start, [], runs)
    assert waited(page, lambda: "replay" in head(page))
    type_time(page, 99.0)
    assert waited(page, lambda: is_drawn(page, "/impacts") is True)
    return session


@pytest.fixture
def phone(page):
    """The page on a screen of a phone's size."""
    size = page.viewport_size
    page.set_viewport_size({"width": 390, "height": 844})
    yield page
    page.set_viewport_size(size)


def is_drawn(page, name):
    """Return whether a node of the scene is drawn, or None if there is no such node."""
    return scene(page).evaluate(
        "name => window.__viserMutable?.nodeRefFromName[name]?.visible ?? null", name
    )


def pixels(page):
    """Of the view, without its edges.  (n, 3)"""
    box = page.locator(".viewport").bounding_box()
    left, top = int(box["x"]) + 10, int(box["y"]) + 10
    right, bottom = left + int(box["width"]) - 20, top + int(box["height"]) - 20
    image = imread(io.BytesIO(page.screenshot(timeout=SLOW)))
    return 255 * image[top:bottom, left:right, :3].reshape(-1, 3)


def near(found, colour, most=14):
    return int((abs(found - np.array(colour)).max(axis=1) < most).sum())


def test_paths_have_the_colours_of_the_legend(page, race):
    """(230, 159, 0) came out as (226, 209, 73), in a view where lines are many pixels wide."""
    orange = (*STYLES["colored"].rgb[:2], 32)  # as near as the renderer can come: some blue is left
    page.locator("[data-act=settings][aria-expanded=true]").click()
    press(page, "chase")
    assert waited(page, lambda: near(pixels(page), orange) > 100, 2)
    assert near(pixels(page), PALE, 6) < 20
    press(page, "free")


def test_all_text_can_be_read(page, race):
    page.mouse.move(600, 400)  # beside all controls, which have hints
    for title in ("All numbers", "Numbers in flight", "View", "Export", "Course editor"):
        group(page, title)
    for tab in ("Laps", "Events", "Planner", "Spectrum", "Signals"):
        page.get_by_role("tab", name=tab).click()
        assert texts_that_can_be_read(page) > 40


def texts_that_can_be_read(part):
    """Return the number of texts of the page or of its frame, once all have enough contrast."""
    found = []

    def is_readable():
        found[:] = part.evaluate(CONTRAST, 4.5)
        return found[1] == []

    # A hint that fades in or out has little contrast for a moment.
    assert waited(part, is_readable, 20), found
    return found[0]


def test_each_visitor_has_a_camera_and_fpv_is_the_drones(page, race):
    p = race.snapshot.competitors[0].rows(("px", "py", "pz"), -1)
    with connect(race.server.get_port()):
        assert waited(page, lambda: len(race.server.get_clients()) == 2)
        mine, others = (
            race.server.get_clients()[k].camera for k in sorted(race.server.get_clients())
        )
        # A new visitor's camera begins where viser puts it, and then looks at the course.
        assert waited(page, lambda: others.position[2] > 10.0)
        before = others.position.copy()
        press(page, "FPV")
        assert waited(page, lambda: np.allclose(mine.position, p, atol=0.01))
        assert np.allclose(others.position, before)
        press(page, "top")
        assert waited(page, lambda: mine.position[2] > 10.0)
    press(page, "free")


def test_on_a_phone_the_head_stays_above_and_nothing_is_wider_than_the_screen(race, phone):
    type_time(phone, 0.4)
    assert waited(phone, lambda: "t 0.40 of" in head(phone))
    for y in (0, 500, 5000):
        phone.evaluate("y => scrollTo(0, y)", y)
        box = phone.locator(".head").bounding_box()
        assert (box["x"], box["y"], box["width"]) == (0, 0, 390)
        assert phone.evaluate("document.documentElement.scrollWidth") == 390
    assert numbers_that_are_cut(phone) == 0
    tower = phone.locator(".tower").bounding_box()
    assert tower["y"] + tower["height"] < 5000
    phone.evaluate("scrollTo(0, 0)")


def numbers_that_are_cut(page):
    """Return how many of the mission's numbers of the tower do not fit into their cells."""
    script = """cells => cells.filter(cell => !cell.textContent || !cell.clientWidth
        || cell.scrollWidth > cell.clientWidth).length"""
    cells = page.locator(".tower td:is(.timed, .hits, .chatter)")
    assert cells.count() >= 3
    return cells.evaluate_all(script)


def is_whole(page):
    """Return whether the tower is in sight, down to its last line."""
    script = """() => {
        const tower = document.querySelector(".tower").getBoundingClientRect();
        const side = document.querySelector(".side").getBoundingClientRect();
        const rows = [...document.querySelectorAll(".tower > *")];
        const end = Math.max(...rows.map((row) => row.getBoundingClientRect().bottom));
        return end <= tower.bottom && tower.bottom <= side.bottom && tower.right <= innerWidth }"""
    return page.evaluate(script)


def test_the_scene_is_not_covered_and_the_tower_is_whole_in_small_windows_and_large_ones(
    page, race
):
    """Also at 200 % of a window of 1280 x 800, which is one of 640 x 400."""
    size = page.viewport_size
    type_time(page, 0.4)
    assert waited(page, lambda: "t 0.40 of" in head(page))
    script = """() => {
        const view = document.querySelector(".viewport"), box = view.getBoundingClientRect();
        const found = [];
        for (const x of [0.05, 0.5, 0.95]) for (const y of [0.05, 0.5, 0.95]) {
            const e = document.elementFromPoint(box.x + x * box.width, box.y + y * box.height);
            if (e && !view.contains(e)) found.push(e.className);
        }
        return [box.width, box.height, found]; }"""
    toggle = page.locator("[data-act=settings]")
    if toggle.get_attribute("aria-expanded") == "true":
        toggle.click()
    sizes = (
        (640, 400, 200),
        (910, 512, 150),
        (1024, 768, 400),
        (1366, 768, 400),
        (2560, 1440, 900),
    )
    for width, height, least in sizes:
        page.set_viewport_size({"width": width, "height": height})
        page.locator(".viewport").scroll_into_view_if_needed()
        wide, high, over = page.evaluate(script)
        assert over == []
        assert wide >= 0.55 * width
        assert high >= least
        assert waited(page, lambda: numbers_that_are_cut(page) == 0)
        assert is_whole(page)
        assert waited(page, lambda: seconds_overlap(page) == [], 10)
    page.set_viewport_size(size)


def seconds_overlap(page):
    """Return the seconds of the time line that begin before the one on their left ends."""
    script = """all => all.filter((e, k) => k && e.getBoundingClientRect().left
        < all[k - 1].getBoundingClientRect().right).map(e => e.textContent)"""
    return page.locator(".seconds span").evaluate_all(script)


@pytest.fixture
def presented(page, race):
    """The page of the race, presented."""
    size = page.viewport_size
    page.keyboard.press("p")
    yield page
    page.keyboard.press("p")
    page.set_viewport_size(size)


def test_presented_the_sentence_and_the_tower_are_whole_in_letters_for_a_room(presented):
    """A line of a slide has a twentieth of its height, a small one a thirtieth."""
    page = presented
    for t, is_final, least in ((0.4, False, 1 / 20), (99, True, 1 / 30)):
        type_time(page, t)
        # the tower of another time has letters of another height
        assert waited(
            page, lambda shown=is_final: (page.locator("body.final").count() > 0) == shown
        )
        for width, height in ((1280, 720), (1920, 1080)):
            page.set_viewport_size({"width": width, "height": height})
            assert waited(page, lambda: numbers_that_are_cut(page) == 0)
            assert is_whole(page)
            assert height_of_letters(page, ".tower td.timed") >= least * height
            assert height_of_letters(page, ".sentence") >= height / 21


def height_of_letters(page, selector):
    """Return the size of the font of an element [px]."""
    script = "e => parseFloat(getComputedStyle(e).fontSize)"
    return page.locator(selector).first.evaluate(script)
