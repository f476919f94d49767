"""Claims about what there is to choose before START, over flights without physics."""

import re

import pytest
from browser_cases import (
    choose,
    drawer,
    field,
    fill,
    press,
    scene,
    waited,
)
from web_cases import COURSE

from quadsim.course import load_course
from quadsim.web.choices import planner_settings
from quadsim.web.race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]

OWN_LAPS = f"course ({load_course(COURSE).laps})"


def gates_drawn(page):
    """Each has four bars."""
    script = """() => {
        const gates = window.__viserMutable.nodeRefFromName["/course/gates"];
        let bars = 0;
        gates?.traverse(node => { bars = node.instancesCount ?? bars });
        return bars / 4 }"""
    return scene(page).evaluate(script)


def unfold(page, group, label):
    """Open a group of numbers and wait for one of them.

    A group that opens moves the groups below it, so a click may miss. A group may be open already.
    """
    drawer(page).get_by_text(group, exact=True).wait_for()
    number = field(page, label).first
    for patience in (0.3, *[2.0] * 10):
        if waited(page, number.is_visible, patience):
            return
        drawer(page).get_by_text(group, exact=True).click()
    raise TimeoutError(f"{label} in {group}")


def test_the_course_is_shown_before_a_start(page):
    choose(page, "Laps", OWN_LAPS)
    for name in ("split_s_swift", COURSE):
        choose(page, "Course", name)
        course = load_course(name)
        gates = len(course.gates)
        assert waited(page, lambda n=gates: gates_drawn(page) == n)
        assert field(page, "Laps").first.input_value() == f"course ({course.laps})"
    choose(page, "Laps", "40")


def test_every_number_of_the_planner_can_be_changed_and_reset(page, session, gliders):
    drawer(page).get_by_text("All numbers", exact=True).click()
    numbers = {
        "Sampling": "Law",
        "MPPI": "Horizon [steps]",
        "Cost": "Progress",
        "Model of the vehicle": "Drag [1/s]",
    }
    for group, number in numbers.items():
        unfold(page, group, number)
    settings = planner_settings("race", "swift", "colored")
    labels = drawer(page).locator("label").all_inner_texts()
    for name, found in settings.items():
        shown = found.setting.field.replace("_", " ")
        wanted = re.compile(rf"{shown}( rates| thrust| scale)?( \[.*\])?", re.IGNORECASE)
        assert any(wanted.fullmatch(label) for label in labels), name
    fill(page, "Horizon [steps]", "100")
    choose(page, "Law", "paper")
    built = len(gliders.built)
    press(page, "START")
    assert waited(page, lambda: len(gliders.built) == built + 1)
    assert gliders.built[-1].choices.settings == {"horizon": 100, "law": "paper"}
    session.tell(PageRace.end_flights)
    press(page, "Reset to preset")
    horizon = field(page, "Horizon [steps]").first
    assert waited(page, lambda: horizon.input_value() == "150")
    drawer(page).get_by_text("All numbers", exact=True).click()
