"""One browser for every test in this folder; it ends with them, as nothing else may use asyncio
meanwhile."""

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from browser_cases import SLOW, dashboard, listen

from web.flight_factory import FlightFactory

playwright = pytest.importorskip(
    "playwright.sync_api", reason="playwright is not installed (pip install -e '.[dev]')"
)
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SOFTWARE = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]
QUIET = [
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
]


@pytest.fixture(scope="package")
def browser():
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine (apt-get install chromium)")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, headless=True, args=SOFTWARE + QUIET)
        yield browser
        browser.close()


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
    listen(page)
    page.goto(session.address)
    page.get_by_role("button", name="START", exact=True).wait_for()
    yield page
    page.close()
