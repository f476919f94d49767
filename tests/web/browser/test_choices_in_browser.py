"""Claims about what there is to choose before START, and how it is called, over flights without
physics."""

import re
from threading import Event

import pytest
from browser_cases import choose, dashboard, field, press, waited
from web_cases import COURSE, Gliders

from controllers.presets import PRESETS
from quadsim.course import load_course
from quadsim.spec.settings import settings_of
from quadsim.spec.systems import SYSTEMS
from web.race import Race


@pytest.fixture(scope="module")
def flights():
    return Gliders()


@pytest.fixture(scope="module")
def session(root, flights):
    with dashboard(root, flights, course=COURSE) as session:
        yield session


def gates_drawn(page):
    """Each has four bars."""
    script = """() => { let bars = 0; window.__viserMutable.nodeRefFromName["/course/gates"]?.traverse(
        o => { bars = o.instancesCount ?? bars }); return bars / 4 }"""
    return page.evaluate(script)


def test_the_course_is_shown_before_a_start(page):
    for name in ("split_s_swift", COURSE):
        choose(page, "Course", name)
        gates = len(load_course(name).gates)
        assert waited(page, lambda n=gates: gates_drawn(page) == n, 20)
        assert field(page, "Laps").first.input_value() == f"course ({load_course(name).laps})"


def test_runs_are_called_by_time_course_sampler_and_result_the_latest_first(page, session):
    session.tell(Race.set_speed, 4.0)
    for laps in ("1", "2"):
        choose(page, "Laps", laps)
        press(page, "START")
        assert waited(page, lambda: session.snapshot.flying)
        assert waited(page, lambda: not session.snapshot.flying)
    session.tell(Race.set_speed, 1.0)
    choose(page, "Laps", f"course ({load_course(COURSE).laps})")
    choose(page, "Mode", "replay")
    field(page, "Run").first.click()
    assert waited(page, lambda: page.get_by_role("option").count() >= 3)
    none, *titles = page.get_by_role("option").all_inner_texts()[:3]
    page.keyboard.press("Escape")
    choose(page, "Mode", "live")
    assert none == "none"
    seconds = [
        re.fullmatch(rf"\d\d:\d\d(:\d\d)? {COURSE} colored (\d+\.\d{{3}}) s", title)[2]
        for title in titles
    ]
    assert float(seconds[0]) > float(seconds[1]) > 0  # two laps, flown last, take longer


def test_every_number_of_the_planner_can_be_changed_and_reset(page, session, flights):
    """And is flown by each sampler that has it."""
    page.get_by_text("All numbers, from the next START").click()
    numbers = {
        "Sampling": "Law",
        "MPPI": "Horizon [steps]",
        "Cost": "Progress",
        "Model of the vehicle": "Drag [1/s]",
    }
    for group, number in numbers.items():
        page.get_by_text(group, exact=True).click()
        # what opens moves the groups below it, and a click would miss them
        field(page, number).first.wait_for()
    named = settings_of(SYSTEMS["quadrotor"], PRESETS["race"]["colored"])
    for name, setting in named.items():
        if setting.group != "flight":
            label = (
                name.removeprefix("model.")
                .replace("_", " ")
                .capitalize()
                .replace("Target ess", "Target ESS")
            )
            wanted = re.compile(rf"^({label}|{label} (rates|thrust|scale))( \[.*\])?$")
            assert page.locator("label").filter(has_text=wanted).count() >= 1, name
    field(page, "Horizon [steps]").first.fill("100")
    field(page, "Law").first.click()
    page.get_by_role("option", name="paper").click()
    choose(page, "Mode", "live: two samplers")
    built = len(flights.built)
    press(page, "START")
    assert waited(page, lambda: len(flights.built) == built + 2)
    colored, gaussian = (flight.choices.settings for flight in flights.built[-2:])
    assert colored == {"horizon": "100", "law": "paper"}
    assert gaussian == {"horizon": "100"}
    session.tell(Race.end_flights)
    press(page, "Reset to preset")
    assert waited(
        page,
        lambda: (
            field(page, "Horizon [steps]").count()
            and field(page, "Horizon [steps]").first.input_value() == "150"
        ),
    )
    choose(page, "Mode", "live")


def test_a_planner_that_is_being_compiled_says_so_in_the_head_up_display(page, session, flights):
    slow, flight = (
        page.get_by_text("Compiling the planner for this machine: once").first,
        flights.flight,
    )
    seen = Event()
    flights.flight = lambda choices: cold(flight(choices), seen)
    press(page, "START")
    slow.wait_for()
    seen.set()
    flights.flight = flight
    assert waited(page, lambda: len(session.snapshot.competitors[0].t))
    assert waited(page, lambda: slow.count() == 0)
    session.tell(Race.end_flights)


def cold(glider, seen):
    """A flight whose first plan takes until the page has been seen to say so."""

    def frames(flown):
        seen.wait(60)
        yield from flown

    glider.is_cached, glider.frames = False, frames(glider.frames)
    return glider
