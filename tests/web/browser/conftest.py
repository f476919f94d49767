"""One browser, and a page over flights without physics that the tests of this folder share.

The browser ends with them, as nothing else may use asyncio meanwhile.
"""

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from browser_cases import dashboard, opened, waited
from web_cases import COURSE, Gliders

from quadsim.web.race.page_race import PageRace

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SOFTWARE = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-accelerated-2d-canvas",
    "--disable-gpu-rasterization",
    "--disable-gpu-compositing",
]
QUIET = [
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
]


@pytest.fixture(scope="package")
def browser():
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed (pip install -e '.[dev]')"
    )
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine (apt-get install chromium)")
    with playwright.sync_playwright() as p:
        browser = p.chromium.launch(executable_path=CHROMIUM, headless=True, args=SOFTWARE + QUIET)
        yield browser
        browser.close()


@pytest.fixture(scope="package")
def root(tmp_path_factory):
    """The folder of runs of the shared session."""
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="package")
def gliders():
    return Gliders()


@pytest.fixture(scope="package")
def shared_session(browser, root, gliders):
    with dashboard(root, gliders, course=COURSE, laps=40) as session:
        yield session


@pytest.fixture(scope="package")
def shared_page(browser, shared_session):
    with opened(browser, shared_session.address) as page:
        yield page


@pytest.fixture
def session(shared_session):
    """The shared session; its flights end with the test."""
    yield shared_session
    # pytest shows it with a failure
    print(*shared_session.snapshot.notices, sep="\n")
    shared_session.tell(PageRace.end_flights)
    shared_session.tell(PageRace.set_speed, 1.0)


@pytest.fixture
def page(shared_page, session):
    """The shared page of the first visitor; no flight is on."""
    assert waited(shared_page, lambda: not session.snapshot.flying)
    yield shared_page
    print(shared_page.locator("button:visible").all_inner_texts())
    print(shared_page.locator("[data-row]").all_inner_texts())
