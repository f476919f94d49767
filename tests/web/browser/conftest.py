"""One browser for every test in this folder; it ends with them, as nothing else may use asyncio meanwhile."""

import shutil
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from browser_cases import SLOW

from web.flight_factory import Choices, FlightFactory

playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (pip install -e '.[dev]')")
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
QUIET = ["--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update"]


@pytest.fixture(scope="package")
def browser():
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine (apt-get install chromium)")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, headless=True, args=SOFTWARE + QUIET)
        yield browser
        browser.close()


@contextmanager
def dashboard(root, flight_factory, **first):
    """A running page: its session, which knows its address."""
    from web.page.dashboard import Dashboard
    from web.page.guard import serve
    from web.page.race_panel import Menu
    from web.session import Session

    server = serve("127.0.0.1", 0, None, "race")
    session = Session(flight_factory, str(root))
    menu = Menu(("split_s_swift", "figure8"), ("swift",), {"race": "swift"}, ("colored", "gaussian"))
    page = Dashboard(server, session, flight_factory, menu, Choices(**first))
    session.server, session.address = server, f"http://127.0.0.1:{server.get_port()}/?fixedDpr=0.4"
    yield session
    page.close()
    session.close()
    server.stop()


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def session(root):
    """Over real flights."""
    with dashboard(root, FlightFactory(), laps=1) as session:
        yield session


@pytest.fixture(scope="module")
def page(browser, session):
    """A visitor's page, opened."""
    page = browser.new_page(viewport={"width": 1200, "height": 800}, accept_downloads=True)
    page.set_default_timeout(SLOW)
    page.goto(session.address)
    page.get_by_role("button", name="START", exact=True).wait_for()
    yield page
    page.close()
