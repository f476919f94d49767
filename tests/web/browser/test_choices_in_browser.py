"""Claims about what there is to choose before START, over flights without physics."""

import re

import pytest
from browser_cases import (
    choose,
    drawer,
    field,
    fill,
    group,
    press,
    scene,
    waited,
)
from web_cases import COURSE

from quadsim.config.settings import SETTINGS
from quadsim.course import load_course
from quadsim.web.race.page_race import PageRace
from quadsim.web.state.choices import planner_kinds

pytestmark = [pytest.mark.browser, pytest.mark.page]


def gates_drawn(page):
    """Each has four bars."""
    script = """() => {
        const gates = window.__viserMutable?.nodeRefFromName["/course/gates"];
        let bars = 0;
        gates?.traverse(node => { bars = node.instancesCount ?? bars });
        return bars / 4 }"""
    return scene(page).evaluate(script)


def test_the_course_is_shown_before_a_start(page):
    fill(page, "Laps", "")
    for name in ("split_s_swift", COURSE):
        choose(page, "Course", name)
        course = load_course(name)
        gates = len(course.gates)
        assert waited(page, lambda n=gates: gates_drawn(page) == n)
        own = f"{course.laps}, the course's"
        assert waited(page, lambda own=own: field(page, "Laps").get_attribute("placeholder") == own)
    fill(page, "Laps", "40")


def test_every_number_of_the_planner_can_be_changed_and_reset(page, session, gliders):
    numbers = group(page, "All numbers")
    assert waited(page, lambda: numbers.locator(".field").count() > 20)
    labels = drawer(page).locator(".field label").all_text_contents()
    for name in planner_kinds("race", "colored"):
        shown = SETTINGS[name].field.replace("_", " ")
        wanted = re.compile(rf"{shown}( rates| thrust| scale)?( \[.*\])?", re.IGNORECASE)
        assert any(wanted.fullmatch(label) for label in labels), name
    for title in ("Sampling", "MPPI", "Cost", "Model of the vehicle"):
        group(page, title)
    fill(page, "Horizon [steps]", "90")
    choose(page, "Law", "paper")
    built = len(gliders.built)
    press(page, "START")
    assert waited(page, lambda: len(gliders.built) == built + 1)
    assert gliders.built[-1].choices.settings == {"horizon": 90, "law": "paper"}
    session.tell(PageRace.end_flights)
    press(page, "Reset to preset")
    horizon = field(page, "Horizon [steps]")
    assert waited(page, lambda: horizon.input_value() == "100")
