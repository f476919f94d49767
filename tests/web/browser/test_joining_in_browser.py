"""Claims about flying by hand in a real browser, by a scripted gamepad and by the keyboard."""

import pytest
from browser_cases import dashboard, opened, press, waited
from hand_cases import WIDE, sticks

from quadsim.firmware.package import find_built
from quadsim.racing.hand import HAND, SINKING
from quadsim.record.archive import list_runs, read_run
from quadsim.web.race.page_race import PageRace, take_off
from quadsim.web.state.choices import flight_controller_of

pytestmark = pytest.mark.browser

STATE = ("px", "py", "pz", "vx", "vy", "vz", "qw", "qx", "qy", "qz")
ATTEMPTS = 4  # to fly a lap
# A gamepad whose sticks spring back to the middle, the throttle to hovering, where the script falls
# silent.
GAMEPAD = """() => {
    const pad = {id: "scripted gamepad", connected: true, mapping: "standard"};
    window.hold = (axes) => Object.assign(window, {axes, heldAt: performance.now()});
    window.hold([0, 0, 0, 0]);
    navigator.getGamepads = () => {
        const silent = performance.now() - window.heldAt > 250;
        const axes = silent ? [0, window.axes[1], 0, 0] : window.axes;
        return window.unplugged ? [] : [{...pad, axes}];
    };
}"""


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return tmp_path_factory.mktemp("by_hand")


@pytest.fixture(scope="module")
def session(root):
    course = root / "wide.yaml"
    course.write_text(WIDE)
    first = {"course": str(course), "sampler": HAND}
    with dashboard(
        root, take_off, flight_controller=flight_controller_of("swift"), **first
    ) as session:
        yield session


@pytest.fixture(scope="module")
def page(browser, session):
    """The page of a visitor with a gamepad."""
    with opened(browser, session.address) as page:
        page.evaluate(GAMEPAD)
        yield page


@pytest.fixture
def waiting(page, session):
    """A vehicle that stands on its start, and a visitor who has its sticks."""
    wait(page, session)
    yield
    session.tell(PageRace.end_flights)
    assert waited(page, lambda: not session.snapshot.flying)


def wait(page, session):
    """Press START and take the sticks."""
    page.evaluate("window.hold([0, 0, 0, 0]), window.unplugged = false")
    race = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race > race and session.snapshot.waiting)
    if session.cockpit.pilot is None:
        press(page, "Take the sticks")
    assert waited(page, lambda: session.cockpit.pilot is not None)


def hold(page, found):
    """Hold the sticks of the gamepad, in mode 2."""
    page.evaluate(
        "axes => window.hold(axes)", [found.yaw, 1 - 2 * found.throttle, found.roll, -found.pitch]
    )


def note(page):
    return page.locator(".cockpit .note").inner_text()


def start(page, session):
    """Pull the throttle down, then raise it."""
    page.evaluate("window.hold([0, 1, 0, 0])")
    assert waited(page, lambda: session.cockpit.was_down)
    page.evaluate("window.hold([0, 0, 0, 0])")
    assert waited(page, lambda: not session.snapshot.waiting)


def fly(page, session):
    """Fly by the scripted pilot until the flight is over; return it."""
    start(page, session)

    def over():
        (entry,) = session.snapshot.competitors
        if entry.outcome is not None:
            return True
        x = [float(entry.x[name][-1]) for name in STATE]
        passed = int(entry.x["passed"][-1])
        hold(page, sticks(entry.course, x, passed))
        return False

    assert waited(page, over)
    assert waited(page, lambda: not session.snapshot.flying)
    (entry,) = session.snapshot.competitors
    return entry


def test_a_scripted_gamepad_flies_a_lap_that_is_kept(page, session, root, waiting):
    """Through Betaflight where it is built, else through an ideal rate loop."""
    assert session.snapshot.waiting  # although the stick rests at hover
    entry = fly(page, session)
    # On a busy machine the sticks lag, and the pilot tries again.
    for _ in range(ATTEMPTS - 1):
        if entry.outcome == "finished":
            break
        wait(page, session)
        entry = fly(page, session)
    assert entry.outcome == "finished", entry.events
    assert "ms both ways" in page.locator(".cockpit .link").inner_text()
    kept = read_run(entry.folder)
    assert entry.folder in list_runs(root)
    assert len(kept.laps) == 1
    assert kept.spec["sampler"] == HAND
    assert bool(kept.spec.get("betaflight")) == (find_built() is not None)
    # what was flown is what the sticks asked for
    assert len(set(kept.telemetry["wy_cmd"].tolist())) > 4.5 * kept.telemetry["t"][-1]
    assert abs(kept.telemetry["wy_cmd"]).max() <= kept.spec[HAND]["pitch"]["most"]


def test_a_link_that_falls_silent_is_said_and_flown_by_the_failsafe(page, session, waiting):
    start(page, session)
    page.evaluate("""() => {
        window.kept = WebSocket.prototype.send;
        WebSocket.prototype.send = function (data) {
            if (!String(data).includes('"sticks"')) window.kept.call(this, data);
        };
    }""")
    assert waited(page, lambda: "FAILSAFE" in note(page))
    (entry,) = session.snapshot.competitors
    assert entry.x["a_cmd"][-1] == pytest.approx(SINKING)
    assert [entry.x[f"w{axis}_cmd"][-1] for axis in "xyz"] == [0.0, 0.0, 0.0]
    page.evaluate("() => { WebSocket.prototype.send = window.kept }")
    hover = session.cockpit.hover
    page.evaluate("throttle => window.hold([0, 1 - 2 * throttle, 0, 0])", hover)
    assert waited(page, lambda: "FAILSAFE" not in note(page))


@pytest.mark.page
def test_keys_fly_and_do_nothing_else_meanwhile(page, session, waiting):
    page.evaluate("window.unplugged = true, document.activeElement.blur()")
    race = session.snapshot.race
    # without a key the throttle is down
    assert waited(page, lambda: "Hold W" in note(page))
    page.keyboard.down("w")
    assert waited(page, lambda: not session.snapshot.waiting)
    page.keyboard.up("w")
    page.keyboard.down("ArrowRight")
    assert waited(page, lambda: session.snapshot.competitors[0].x["wx_cmd"][-1] > 1.0)
    page.keyboard.up("ArrowRight")
    # without a key the sticks return to the middle, the throttle to hovering
    assert waited(page, lambda: abs(session.snapshot.competitors[0].x["wx_cmd"][-1]) < 1e-6)
    page.keyboard.press("x")  # elsewhere it stops the race
    page.keyboard.press("s")  # and this starts another
    page.keyboard.press("Escape")
    assert waited(page, lambda: session.cockpit.pilot is None)
    assert session.snapshot.race == race
    assert session.snapshot.flying
    page.keyboard.press("x")
    assert waited(page, lambda: not session.snapshot.flying)
