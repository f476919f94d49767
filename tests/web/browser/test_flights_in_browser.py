"""Claims about real flights in a real browser: the planner on few samples, a pilot on sensors."""

import re

import numpy as np
import pytest
from browser_cases import (
    HELD,
    SLOW,
    add_rival,
    choose,
    dashboard,
    drone,
    field,
    group,
    head,
    opened,
    press,
    rows,
    scene,
    shown_time,
    type_time,
    waited,
)

from quadsim.record.archive import list_runs, read_run
from quadsim.web.page.scene.race_scene import visible_scale
from quadsim.web.race.page_race import PageRace, take_off
from quadsim.web.state.choices import PILOT
from quadsim.web.state.numbers import SLIDERS
from tests.small import SMALL

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return tmp_path_factory.mktemp("flights")


@pytest.fixture(scope="module")
def session(root):
    # as many samples as the first gate takes
    settings = SMALL | {"samples": 256, "timeout": 4.0}
    with dashboard(root, take_off, laps=1, settings=settings) as session:
        yield session


@pytest.fixture(scope="module")
def page(browser, session):
    with opened(browser, session.address) as page:
        yield page


# What the head says at once, before any answer of the server
ANSWER = """() => { document.querySelector("[data-act=start]").click();
                 return document.querySelector(".sentence").textContent }"""


def start(page, session):
    races = session.snapshot.race
    assert page.evaluate(ANSWER).startswith("START: ")
    assert waited(page, lambda: session.snapshot.race > races)


@pytest.fixture(scope="module")
def piloted(page, session):
    """A pilot that flies on a gate camera, held in the third second."""
    choose(page, "Sampler", f"{PILOT}split_s_swift")
    choose(page, "Sensing", "gates")
    assert waited(page, lambda: "START flies pilot" in head(page))
    start(page, session)
    assert waited(page, lambda: session.snapshot.t > 2.0)
    session.tell(PageRace.set_speed, HELD)
    assert waited(page, lambda: session.snapshot.speed == HELD)
    return session.snapshot.competitors[0]


@pytest.fixture(scope="module")
def replayed(page, session, root, piloted):
    """The run of that flight, replayed."""
    session.tell(PageRace.end_flights)
    assert waited(page, lambda: list_runs(root))
    (folder,) = list_runs(root)
    page.keyboard.press("t")
    press(page, "replay")
    assert waited(page, lambda: not session.snapshot.competitors[0].live)
    session.tell(PageRace.set_speed, 1.0)
    return read_run(folder).telemetry


def estimate(page, part):
    """Position and visibility of a part of the estimate in the scene; None: there is none."""
    script = """name => { const n = window.__viserMutable?.nodeRefFromName["/estimate/0/" + name];
                return n ? {at: n.position.toArray(), visible: n.visible} : null }"""
    return scene(page).evaluate(script, part)


def stands_at(page, part, place):
    found = estimate(page, part)
    return found is not None and np.allclose(found["at"], place, atol=1e-3)


def drawn(course, x, i):
    """Return where the ghost is: off the drone as the estimate is, enlarged as the drone is."""
    truth = np.array([x[f"p{axis}"][i] for axis in "xyz"])
    estimate = np.array([x[f"est_p{axis}"][i] for axis in "xyz"])
    return truth + visible_scale(course) * (estimate - truth)


def test_the_pilot_and_the_sensors_that_are_chosen_are_flown_and_shown(page, piloted):
    assert piloted.spec.sampler == "pilot"
    assert piloted.spec.pilot.name == "split_s_swift"
    assert piloted.spec.sensing.name == "gates"
    assert waited(page, lambda: "sensing gates" in head(page))
    page.get_by_role("tab", name="Planner").click()
    page.get_by_text("learned pilot split_s_swift").wait_for()


@pytest.mark.page
def test_the_estimate_is_drawn_where_it_is_and_the_corners_of_the_last_picture(page, piloted):
    place = drawn(piloted.course, piloted.x, -1)
    assert not np.allclose(place, piloted.rows(("px", "py", "pz"), -1), atol=1e-3)
    for part in ("ghost", "ellipsoid"):
        assert waited(page, lambda p=part: stands_at(page, p, place))
    assert piloted.corners is not None
    recent = piloted.t[-1] - piloted.corners.t <= 0.25
    assert waited(page, lambda: estimate(page, "corners")["visible"] == recent)


def test_a_scrubbed_replay_shows_drone_and_estimate_where_the_telemetry_says(
    page, session, piloted, replayed
):
    for t in (1.0, 1.7):
        i = int(np.argmin(abs(replayed["t"] - t)))
        there = np.array([replayed[f"p{axis}"][i] for axis in "xyz"])
        ghost = drawn(piloted.course, replayed, i)
        type_time(page, t)
        assert waited(page, lambda at=t: shown_time(page) == at)
        assert waited(page, lambda p=there: np.allclose(drone(scene(page)) or np.inf, p, atol=1e-3))
        assert waited(page, lambda p=ghost: stands_at(page, "ghost", p))
    for _ in range(2):  # beyond the end: the box shows the end, where it is shown already, too
        type_time(page, 1e5)
        assert waited(page, lambda: abs(shown_time(page) - replayed["t"][-1]) < 0.01)
    type_time(page, 1.7)
    disabled = group(page, "Numbers in flight").locator("input[type=range]:disabled")
    assert waited(page, lambda: disabled.count() == len(SLIDERS))


@pytest.mark.page
def test_the_exported_page_plays_without_a_network(browser, page, replayed, tmp_path):
    group(page, "Export")
    with page.expect_download() as download:
        press(page, "page")
    path = tmp_path / "race.html"
    download.value.save_as(path)
    context = browser.new_context(offline=True)
    offline = context.new_page()
    offline.goto(path.as_uri(), timeout=SLOW)
    places = []

    def moves():
        at = drone(offline)
        if at is not None:
            places.append(at)
        return len(places) > 1 and np.ptp(np.array(places), axis=0).max() > 1.0

    assert waited(offline, moves, 60)
    context.close()


@pytest.mark.page
def test_a_race_in_one_world_is_flown_and_shown(page, session):
    choose(page, "Sampler", "colored")
    choose(page, "Sensing", "perfect")
    add_rival(page, "gaussian")
    choose(page, "Fly", "in one world")
    assert waited(page, lambda: rows(page).count() == 2)
    start(page, session)
    assert waited(page, lambda: session.snapshot.t > 0.3)
    session.tell(PageRace.set_speed, HELD)
    names = [entry.name for entry in session.snapshot.competitors]
    assert names == ["colored", "gaussian"]
    # each expects the other one somewhere
    assert [len(entry.expected) for entry in session.snapshot.competitors] == [1, 1]
    compared = "(colored|gaussian) (leads|is level with) (colored|gaussian)"
    assert waited(page, lambda: re.search(compared, head(page)))
    numbers = group(page, "Numbers in flight")
    numbers.get_by_text("in one world the numbers of START stay").first.wait_for()
    assert waited(page, lambda: field(page, "Samples now").is_disabled())
    press(page, "STOP")
    assert waited(page, lambda: not session.snapshot.flying)
    assert page.complaints == []
