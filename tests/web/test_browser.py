"""Claims about the page in a real browser, with the real planner on fewer samples."""

import json
import re
import shutil

import numpy as np
import pytest

from controllers.presets import PRESETS
from quadsim.record.archive import list_runs, load_run
from web.flight_factory import RANGES, Choices, FlightFactory
from web.race import Race

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (pip install -e '.[dev]')")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine (apt-get install chromium)")

SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
QUIET = ["--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update"]
SLOW = 60_000  # [ms] a first frame drawn in software


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def session(root):
    from web.page.dashboard import Dashboard
    from web.page.guard import serve
    from web.page.race_panel import Menu
    from web.session import Session

    server = serve("127.0.0.1", 0, None, "race")
    session = Session(FlightFactory(), str(root))
    menu = Menu(("split_s_swift",), ("swift",), {"race": "swift"}, ("colored", "gaussian"))
    dashboard = Dashboard(server, session, FlightFactory(), menu, Choices(laps=1))
    session.address = f"http://127.0.0.1:{server.get_port()}/?fixedDpr=0.4"
    yield session
    dashboard.close()
    session.close()
    server.stop()


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, headless=True, args=SOFTWARE + QUIET)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def page(browser, session):
    page = browser.new_page(viewport={"width": 1200, "height": 800}, accept_downloads=True)
    page.set_default_timeout(SLOW)
    page.goto(session.address)
    page.get_by_role("button", name="START", exact=True).wait_for()
    return page


@pytest.fixture(scope="module")
def flown(page, session, root):
    """A colored and a Gaussian flight, started from the page, and their runs."""
    choose(page, "Mode", "live: two samplers")
    fill(page, "Samples", 512)
    choose(page, "Speed", "4")
    page.get_by_role("button", name="START", exact=True).click()
    assert waited(page, lambda: session.snapshot.flying, 60)
    assert waited(page, lambda: session.snapshot.race and not session.snapshot.flying, 120)
    return [json.loads((folder / "run.json").read_text()) for folder in list_runs(root)]


def field(page, label):
    """The inputs of a control."""
    label = page.locator("label").filter(has_text=re.compile(f"^{re.escape(label)}$"))
    return label.locator("xpath=ancestor::div[contains(@class,'Flex-root')][1]").locator("input:not([type=hidden])")


def choose(page, label, option):
    field(page, label).click()
    page.get_by_role("option", name=option, exact=True).click()


def fill(page, label, value):
    field(page, label).last.fill(str(value))
    field(page, label).last.press("Enter")


def seen(page, words):
    """Wait until they can be read."""
    page.locator(":is(td, span, p, b):visible", has_text=words).first.wait_for()


def waited(page, claim, seconds=90):
    """Whether it comes true while the browser lives on."""
    for _ in range(int(seconds / 0.1)):
        if claim():
            return True
        page.wait_for_timeout(100)
    return False


def drone(page, k=0):
    """Where the page draws a drone [m]."""
    script = """name => { const n = window.__viserMutable?.nodeRefFromName[name];
                return n ? [n.position.x, n.position.y, n.position.z] : null }"""
    return page.evaluate(script, f"/competitor/{k}")


def test_both_laps_are_in_the_table_as_they_are_in_run_json(page, flown):
    page.get_by_role("tab", name="Laps").click()
    assert {run["spec"]["sampler"] for run in flown} == {"colored", "gaussian"}
    for run in flown:
        (lap,) = run["laps"]
        seen(page, f"{lap:.3f}")


def test_moving_gamma_in_flight_shows_an_event(page, session, flown):
    choose(page, "Mode", "live")
    page.get_by_role("button", name="START", exact=True).click()
    assert waited(page, lambda: session.snapshot.flying and session.snapshot.t > 0.05)
    fill(page, "Gamma rates", 1.5)
    page.get_by_role("tab", name="Events").click()
    seen(page, f"gamma rates {PRESETS['race']['colored'].sampling.gamma[0]:g} → 1.5")
    seen(page, "interactive, not comparable")
    session.tell(Race.end_flights)


def scrubbed(page, t):
    """Whether the time field holds t; typed again where the page set another time in between."""
    if float(field(page, "Time [s]").last.input_value()) != t:
        fill(page, "Time [s]", t)
        page.wait_for_timeout(500)
    return float(field(page, "Time [s]").last.input_value()) == t


def test_a_scrubbed_replay_shows_the_drone_where_the_telemetry_says(page, session, root, flown):
    folder = next(f for f in list_runs(root) if "colored" in f.name)
    x = load_run(folder).telemetry
    choose(page, "Mode", "replay")
    choose(page, "Run", folder.name)
    page.get_by_role("button", name="REPLAY", exact=True).click()
    assert waited(page, lambda: session.snapshot.competitors and not session.snapshot.competitors[0].live)
    session.tell(Race.play, False)  # a slider that moves by itself cannot be typed into
    assert waited(page, lambda: session.snapshot.race and not session.snapshot.playing)
    for t in (2.0, 3.5):
        i = int(np.argmin(abs(x["t"] - t)))
        there = np.array([x[k][i] for k in ("px", "py", "pz")])
        assert waited(page, lambda at=t: scrubbed(page, at))
        assert waited(page, lambda p=there: drone(page) is not None and np.allclose(drone(page), p, atol=1e-3))
    assert waited(page, lambda: page.locator("[role=slider][aria-disabled=true]").count() >= len(RANGES))


def test_the_exported_page_plays_without_a_network(browser, page, session, flown, tmp_path):
    page.get_by_text("Export", exact=True).click()
    with page.expect_download() as download:
        page.get_by_role("button", name="page", exact=True).click()
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
    assert offline.get_by_text("splits by gate").count() == 1
    context.close()
