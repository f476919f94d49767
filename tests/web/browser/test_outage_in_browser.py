"""Claims that a page comes back after the server was away."""

import pytest
from browser_cases import (
    opened,
    scene,
    waited,
)
from web_cases import free_port

from quadsim.web.page.server import serve

pytestmark = pytest.mark.browser

# Chromium delays connections after many that failed, as after an outage of a minute. These fail
# now; the promise is kept once all have.
MANY_FAILURES = """() => Promise.all([...Array(40)].map(() => new Promise(done => {
    const socket = new WebSocket(location.origin.replace("http", "ws"));
    socket.onclose = done; })))"""


def served(port, words):
    server = serve("127.0.0.1", port, None, "race")
    server.gui.add_html(f"<p>Course editor</p><p>{words}</p>")
    return server


def test_after_a_long_outage_the_page_connects_again(browser):
    port = free_port()
    server = served(port, "the first server")
    with opened(browser, f"http://127.0.0.1:{port}/?fixedDpr=0.2") as page:
        server.stop()
        lost = page.get_by_role("status").filter(has_text="Disconnected")
        lost.first.wait_for()
        page.evaluate(MANY_FAILURES)
        assert lost.count() == 1
        server = served(port, "the second server")
        try:
            there = scene(page).get_by_text("the second server")
            assert waited(page, lambda: there.count() == 1 and lost.count() == 0, 15)
        finally:
            server.stop()
