"""Claims about keys, the focus and the sizes of texts, over flights without physics."""

import pytest
from browser_cases import (
    HELD,
    choose,
    field,
    fill,
    group,
    head,
    press,
    scene,
    type_time,
    waited,
)
from web_cases import choices, stored

from quadsim.web.race.page_race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]

# texts smaller than 12 px as they are drawn, those in a drawing by its scale
SMALL = """() => {
  const found = [];
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node; (node = texts.nextNode()); ) {
    const parent = node.parentElement;
    if (!node.textContent.trim() || !parent.checkVisibility({ opacityProperty: true })) continue;
    if (["SCRIPT", "STYLE", "title"].includes(parent.tagName)) continue;
    const scale = parent.ownerSVGElement ? parent.getScreenCTM().a : 1;
    const size = scale * parseFloat(getComputedStyle(parent).fontSize);
    if (size < 11.95) found.push([size, node.textContent.trim().slice(0, 30)]);
  }
  for (const input of document.querySelectorAll("input")) {
    const size = parseFloat(getComputedStyle(input).fontSize);
    if (input.checkVisibility() && size < 11.95) found.push([size, input.value]);
  }
  return found; }"""


@pytest.fixture(autouse=True)
def at_rest(page):
    """Nothing has the focus, and the camera is free."""
    blur(page)
    press(page, "free")
    assert waited(page, lambda: pressed(page) == ["free"], 5)


def blur(page):
    for part in (page, scene(page)):
        part.evaluate("document.activeElement.blur()")


def has_focus(page, element):
    return element.evaluate("e => e === document.activeElement")


def pressed(page):
    """The camera that is marked."""
    marked = page.locator("[data-camera][aria-pressed=true]:visible")
    return marked.all_inner_texts()


def test_escape_and_a_click_beside_it_close_the_help_and_keys_do_not_act_beneath(page, session):
    race = session.snapshot.race
    help_window = page.get_by_role("dialog").filter(has_text="Keys")
    page.keyboard.press("h")
    help_window.wait_for()
    page.keyboard.press("c")
    page.keyboard.press("s")
    page.keyboard.press("Escape")
    help_window.wait_for(state="detached")
    page.keyboard.press("h")  # acts after those before it
    help_window.wait_for()
    assert pressed(page) == ["free"]
    assert session.snapshot.race == race
    page.mouse.click(20, 700)
    help_window.wait_for(state="detached")


def test_keys_act_again_after_a_number_a_choice_and_a_tick(page, session):
    acts_after_a_choice_and_a_tick(page)
    for key in ("Enter", "Escape"):
        blur(page)
        press(page, "free")
        assert waited(page, lambda: pressed(page) == ["free"], 5)
        acts_after_typing(page, key)


def acts_after_typing(page, key):
    box = field(page, "Seed")
    box.click()
    page.keyboard.press("c")
    assert pressed(page) == ["free"]  # the box has it
    page.keyboard.press(key)
    assert waited(page, lambda: not has_focus(page, box), 5)
    page.keyboard.press("c")
    assert waited(page, lambda: pressed(page) == ["chase"], 5)
    fill(page, "Seed", 0)  # Enter has taken the "c", with which START would fly nothing


def acts_after_a_choice_and_a_tick(page):
    group(page, "View")
    choose(page, "Trails", "speed")
    field(page, "Trails").evaluate("e => e.blur()")  # as a choice by mouse does
    page.keyboard.press("c")
    assert waited(page, lambda: pressed(page) == ["chase"], 5)
    tick = field(page, "True size")
    tick.click()
    tick.click()
    page.keyboard.press("c")
    assert waited(page, lambda: pressed(page) == ["top"], 5)
    choose(page, "Trails", "auto")


def test_no_text_is_smaller_than_12_pixels(page, session, root):
    run = stored(root, "gaussian", laps=2)
    session.tell(PageRace.start, [choices("colored", laps=2)], [run])
    assert waited(page, lambda: session.snapshot.t > 0.2)
    session.tell(PageRace.set_speed, HELD)
    for title in ("Numbers in flight", "All numbers", "View"):
        group(page, title)
    for tab in ("Laps", "Events", "Planner", "Signals"):
        page.get_by_role("tab", name=tab, exact=True).click()
        assert waited(page, lambda: page.evaluate(SMALL) == [], 3), page.evaluate(SMALL)


def test_a_camera_picture_is_shown_when_it_is_asked_for(page, session, root):
    pytest.importorskip("pybullet")
    session.tell(PageRace.start, [], [stored(root, "colored", laps=2)])
    assert waited(page, lambda: "replay" in head(page))
    type_time(page, 0.2)
    group(page, "View")
    picture = page.get_by_alt_text("What the camera of colored at 0.20 s sees")
    assert picture.count() == 0
    field(page, "Camera pictures").check()
    picture.wait_for()
    assert picture.evaluate("e => e.naturalWidth") == 320
    field(page, "Camera pictures").uncheck()
    picture.wait_for(state="detached")
    assert page.complaints == []
