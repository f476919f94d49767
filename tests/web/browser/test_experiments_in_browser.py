"""Claims that what the page's sliders say is what is flown, and what is flown is recorded.

The flights are without physics; that the planner itself takes a number over is claimed in
test_flights_in_browser.
"""

import pytest
from browser_cases import (
    add,
    alone,
    choose,
    drawer,
    field,
    fill,
    group,
    press,
    rows,
    waited,
)

from quadsim.controllers.presets import PRESETS
from quadsim.web.race.page_race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]

PRESET = PRESETS["race"]
SAMPLERS = ("colored", "gaussian")


def shown(page, label):
    return float(field(page, label).input_value())


def changes(session):
    """Of every competitor, without their times."""
    competitors = session.snapshot.competitors
    return [[(c.name, c.before, c.after) for c in entry.changes] for entry in competitors]


def planners(session):
    return [entry.record["planner"] for entry in session.snapshot.competitors]


def start(page, session):
    races = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race > races and session.snapshot.t > 0.05)


@pytest.fixture(autouse=True)
def preset(page):
    """There is one competitor, with the preset's numbers."""
    alone(page)


def test_each_competitor_flies_numbers_of_its_own(page, session):
    """Two of one sampler differ in name, colour and line, and in one number."""
    fill(page, "Samples", 512)
    add(page)
    fill(page, "Samples", 2048)
    fill(page, "Sigma scale", 1.5)
    assert waited(page, lambda: "sigma scale 1.5 · samples 2048" in rows(page).last.inner_text())
    rows(page).first.click()  # a click on a row shows its numbers
    assert waited(page, lambda: shown(page, "Samples") == 512)
    start(page, session)
    first, second = session.snapshot.competitors
    assert (first.name, second.name) == ("colored samples 512", "colored samples 2048")
    assert first.style.colour != second.style.colour
    assert first.style.dash != second.style.dash
    assert [entry.spec.planner.mppi.samples for entry in (first, second)] == [512, 2048]
    sigma = PRESET["colored"].sampling.sigma
    assert list(first.record["planner"]["sampling"]["sigma"]) == pytest.approx(sigma)
    wanted = [1.5 * one for one in sigma]
    assert list(second.record["planner"]["sampling"]["sigma"]) == pytest.approx(wanted)


def test_a_drag_is_one_change_at_the_time_of_the_plan_that_used_it(page, session):
    session.tell(PageRace.set_speed, 0.2)  # the flight lasts while a busy machine finds the slider
    start(page, session)
    group(page, "Numbers in flight")
    slider = drawer(page).get_by_role("slider", name="Sigma scale now")
    assert waited(page, slider.is_enabled)
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.3 * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.65 * box["width"], y, steps=8)
    page.wait_for_timeout(800)  # a slider that is held does not act
    assert not changes(session)[0]
    page.mouse.up()
    assert waited(page, lambda: changes(session)[0])
    last = shown(page, "Sigma scale now")
    frames = len(session.snapshot.competitors[0].t)
    assert waited(page, lambda: len(session.snapshot.competitors[0].t) > frames + 30)
    (change,) = session.snapshot.competitors[0].changes
    assert (change.name, change.before, change.after) == ("sigma", 1, last)
    assert change.t in session.snapshot.competitors[0].t
    assert change.t > 0.1


GROUPS = ["Sampling", "MPPI", "Cost", "Model of the vehicle"]


def groups(page):
    """The titles of the groups of numbers, in order."""
    return drawer(page).locator(".fold > summary").all_text_contents()


def test_presets_chosen_quickly_leave_one_set_of_groups_with_the_last_ones_numbers(
    page, session, capfd
):
    group(page, "All numbers")
    for preset in ("paper", "race", "paper", "race", "paper"):
        choose(page, "Preset", preset)
    choose(page, "Sampler", "gaussian")
    choose(page, "Sampler", "colored")
    assert waited(page, lambda: groups(page) == GROUPS), groups(page)
    page.wait_for_timeout(300)
    assert groups(page) == GROUPS
    group(page, "Cost")
    speed = PRESETS["paper"]["colored"].cost.desired_speed
    assert waited(page, lambda: float(field(page, "Desired speed [m/s]").input_value()) == speed)
    start(page, session)
    assert session.snapshot.competitors[0].spec.preset == "paper"
    assert planners(session)[0]["cost"]["desired_speed"] == speed
    assert "Traceback" not in "".join(capfd.readouterr())
    choose(page, "Preset", "race")
    choose(page, "Vehicle", "swift")
