"""Claims that a page comes back after the server was away."""

from contextlib import ExitStack, contextmanager

import pytest
from browser_cases import (
    DRAWN,
    head,
    opened,
    scene,
    waited,
)
from web_cases import COURSE, MENU, Gliders, free_port, served

from quadsim.web.state.choices import Choices

pytestmark = pytest.mark.browser

# Chromium delays connections after many that failed, as after an outage of a minute. These fail
# now; the promise is kept once all have.
MANY_FAILURES = """() => Promise.all([...Array(40)].map(() => new Promise(done => {
    const socket = new WebSocket(location.origin.replace("http", "ws"));
    socket.onclose = done; })))"""


def test_after_a_long_outage_the_page_and_its_scene_connect_again(browser, tmp_path):
    port = free_port()
    with opened_page(browser, port, tmp_path) as page:
        seat = scene(page).url
        lost = page.get_by_role("status").filter(has_text="Disconnected")
        lost.first.wait_for()
        assert "disconnected" in page.title()
        # nothing looks alive that is not, and what is not sent is told
        assert page.locator("[data-act=start]").evaluate("e => e.inert")
        page.keyboard.press("s")
        page.get_by_text("Not sent").wait_for()
        assert "the server is away" in head(page)
        page.evaluate(MANY_FAILURES)
        assert lost.count() == 1
        with served(tmp_path, Gliders(), MENU, Choices(course=COURSE), port) as again:
            assert waited(page, lambda: lost.count() == 0)
            assert waited(page, lambda: len(again.server.get_clients()) == 1)
            assert scene(page).url != seat
            assert page.title() == "race"
            assert not page.locator("[data-act=start]").evaluate("e => e.inert")


@contextmanager
def opened_page(browser, port, root):
    """The page of a server that has ended."""
    with ExitStack() as stack:
        with served(root, Gliders(), MENU, Choices(course=COURSE), port):
            page = stack.enter_context(opened(browser, f"http://127.0.0.1:{port}/{DRAWN}"))
        yield page
