"""A course is made in a real browser, flown, stored, and flown again by the command."""

import re
import shlex

import pytest
from browser_cases import (
    HELD,
    button,
    choose,
    dashboard,
    field,
    fill,
    group,
    opened,
    press,
    scene,
    waited,
)
from wire import link

from quadsim.cli.cli import race
from quadsim.course import load_course
from quadsim.record.archive import list_runs, read_run
from quadsim.record.run import same_flight
from quadsim.web.race.page_race import PageRace, take_off
from tests.small import SMALL, flags

pytestmark = [pytest.mark.browser, pytest.mark.page]

# as many samples and iterations as two gates in a row take
SETTINGS = SMALL | {"samples": 512, "iterations": 2}
FLAGS = ["--sampler", "gaussian", "--laps", "1", *flags(SETTINGS)]

# Pixel at which a point of a handle is drawn, in its own axes [m]
PIXEL = """([name, x, y, z]) => {
    const m = window.__viserMutable, node = m.nodeRefFromName[name];
    if (!node) return null;
    node.updateWorldMatrix(true, true);
    const p = node.position.clone().set(x, y, z).applyMatrix4(node.matrixWorld).project(m.camera);
    const box = m.canvas.getBoundingClientRect();
    return [box.x + (p.x + 1) / 2 * box.width, box.y + (1 - p.y) / 2 * box.height];
}"""
NODES = """() => Object.entries(window.__viserMutable.nodeRefFromName)
    .filter(([, node]) => node).map(([name]) => name)"""

DRAWN = 1000  # [ms] until settings that were closed show the editor as it is


def open_editor(page, way="New course"):
    group(page, "Course editor")
    press(page, way)
    button(page, "Done").wait_for()


def handle_of(page):
    """The name of the handle that is drawn last; one that was removed may be drawn for a moment."""
    names = [
        name for name in scene(page).evaluate(NODES) if re.fullmatch(r"/edit/handle/\d+", name)
    ]
    return max(names, key=lambda name: int(name.rpartition("/")[2]), default=None)


def pixel(page, point):
    """Return the pixel of the window at which a point of a handle is drawn; None: not yet."""
    spot = scene(page).evaluate(PIXEL, point)
    frame = page.locator("iframe").bounding_box()
    return spot and [spot[0] + frame["x"], spot[1] + frame["y"]]


def resting(page, point):
    """Return the handle, and the pixel of a point of it, once camera and handles rest."""
    for _ in range(50):
        name = handle_of(page)
        spot = name and pixel(page, [name, *point])
        page.wait_for_timeout(300)
        if spot and handle_of(page) == name and pixel(page, [name, *point]) == spot:
            return name, spot
    raise TimeoutError(point)


def told(page, words):
    """Wait until the page says it."""
    assert waited(page, lambda: page.get_by_text(words).count() > 0), words


def shown(page, label):
    return float(field(page, label).input_value())


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return tmp_path_factory.mktemp("courses")


@pytest.fixture(scope="module")
def shared_session(browser, root):
    with dashboard(
        root, take_off, course="figure8", settings=SETTINGS | {"samples": 256}
    ) as session:
        yield session


@pytest.fixture(scope="module")
def shared_page(browser, shared_session):
    with opened(browser, shared_session.address) as page:
        yield page
        assert not page.complaints


@pytest.fixture
def page(shared_page, session):
    """A page on which no course is edited."""
    yield shared_page
    group(shared_page, "Course editor")
    shared_page.wait_for_timeout(DRAWN)
    if button(shared_page, "Done").count():
        press(shared_page, "Done")


def test_a_course_made_in_the_browser_is_flown_again_by_the_command_to_the_same_bits(
    page, session, root, capsys
):
    open_editor(page)
    told(page, "no gate yet")
    for item in ("gate 1", "gate 2"):
        press(page, "add gate")
        assert waited(page, lambda i=item: field(page, "Item").input_value() == i)
    fill(page, "y [m]", 1.25)
    fill(page, "Yaw [deg]", 20)
    press(page, "add pole")
    fill(page, "Name", "made_here")
    press(page, "Save and choose")
    told(page, "race fly")
    command = re.search(r"race fly \S+", page.locator(".editing").inner_text())[0]
    path = str(root / "courses" / "made_here.yaml")
    assert command == f"race fly {path}"
    course = load_course(path)
    assert course.gates[1].position == (10.0, 1.25, 1.12)
    assert len(course.obstacles) == 1

    assert waited(page, lambda: field(page, "Course").input_value() == path)
    choose(page, "Sampler", "gaussian")
    fill(page, "Seed", 3)
    fill(page, "Samples", 512)
    session.tell(PageRace.set_speed, 20.0)
    press(page, "START")
    assert waited(page, lambda: session.snapshot.flying)
    assert waited(page, lambda: not session.snapshot.flying)
    assert session.snapshot.competitors[0].course == course

    (first,) = list_runs(root)
    flown = read_run(first)
    assert flown.outcome == "finished"
    words = shlex.split(command)[1:]
    assert race([*words, *FLAGS, "--seed", "3", "--runs-dir", str(root)]) == 0
    assert race(["fly", "--from", str(first), "--runs-dir", str(root)]) == 0
    assert "the same flight as the stored run, to the last bit" in capsys.readouterr().err
    again = set(list_runs(root)) - {first}
    assert len(again) == 2
    assert all(same_flight(read_run(run), flown) for run in again)


def test_the_editor_waits_for_a_flight_and_is_closed_by_a_start(page, session):
    choose(page, "Course", "figure8")
    # This planner crashes after some seconds, which a slow page would miss.
    session.tell(PageRace.set_speed, HELD)
    press(page, "START")
    assert waited(page, lambda: session.snapshot.flying)
    group(page, "Course editor")
    press(page, "New course")
    told(page, "a flight is on")
    press(page, "STOP")
    assert waited(page, lambda: not session.snapshot.flying)
    press(page, "New course")
    button(page, "Done").wait_for()
    press(page, "add gate")
    press(page, "START")
    button(page, "Go on editing").wait_for()
    assert waited(page, lambda: session.snapshot.flying)
    press(page, "STOP")
    assert waited(page, lambda: not session.snapshot.flying)
    press(page, "Go on editing")
    assert waited(page, lambda: field(page, "Item").input_value() == "gate 1")


def test_a_gate_is_dragged_by_its_handle_and_every_visitor_sees_it(page, session):
    open_editor(page)
    press(page, "add gate")
    assert waited(page, lambda: field(page, "Item").input_value() == "gate 1")
    assert waited(page, lambda: handle_of(page) and pixel(page, [handle_of(page), 0, 0, 0]))
    before = [shown(page, f"{axis} [m]") for axis in "xyz"]
    with link(session.server.get_port()) as other:
        assert other.press("editor", "resume") == ""

        def x_of_other():
            return other.form("editor")[0]["number x"]["value"]

        # the tip of the arrow along the passage
        name, start = resting(page, [1.8, 0, 0])
        end = pixel(page, [name, 3.8, 0, 0])
        page.mouse.move(*start)
        page.mouse.down()
        for share in (0.3, 0.6, 1.0):
            page.mouse.move(*(a + share * (b - a) for a, b in zip(start, end, strict=True)))
            page.wait_for_timeout(100)
        page.mouse.up()
        assert waited(page, lambda: abs(shown(page, "x [m]") - before[0] - 2.0) < 0.2)
        moved = shown(page, "x [m]")
        assert round(moved, 2) == moved
        assert x_of_other() == moved
        assert [shown(page, f"{axis} [m]") for axis in "yz"] == before[1:]

        # One drag is one change, also for the other visitor.
        assert other.press("editor", "undo") == ""
        assert waited(page, lambda: [shown(page, f"{axis} [m]") for axis in "xyz"] == before)


def test_two_who_edit_at_once_break_nothing(page, session, capfd):
    """One deletes what the other one types at."""
    open_editor(page, "Edit a copy")
    with link(session.server.get_port()) as other:
        assert other.press("editor", "resume") == ""
        for k in range(3):
            field(page, "x").fill(str(k))
            other.press("editor", "delete")
        page.keyboard.press("Enter")
        for _ in range(2):
            press(page, "undo")
            other.press("editor", "box")

        def is_the_same_for_both():
            item = other.form("editor")[0]["item"]["value"]
            return field(page, "Item").input_value() == item

        assert waited(page, is_the_same_for_both)
    assert "Traceback" not in capfd.readouterr().err
