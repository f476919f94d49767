"""Claims that a link or a foreign page cannot make the page talk to another server or run a foreign
script."""

import socket
import threading
from contextlib import contextmanager

import pytest
from browser_cases import waited

from quadsim.web.page.server.seats import SCENE as SCENES

pytestmark = pytest.mark.browser

SCENE = f"{SCENES}a_seat_of_this_test"


@pytest.fixture(autouse=True)
def provoked(page):
    """Forget the console's messages on the blocked requests that a test provokes."""
    before = len(page.complaints)
    yield
    page.evaluate("0")  # is answered after the messages of the console before it
    del page.complaints[before:]


@contextmanager
def stranger():
    """A foreign server: its port, and what has called it."""
    calls = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def listen():
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                calls.append(connection.recv(4000))
                connection.close()

        threading.Thread(target=listen, daemon=True).start()
        yield server.getsockname()[1], calls


def test_a_link_cannot_make_the_page_talk_to_another_server(browser, session):
    """The policy blocks what viser's page would do with it; the page passes nothing of it on."""
    scene = session.address.replace("/?", f"{SCENE}?")
    with stranger() as (port, calls):
        page = browser.new_page(viewport={"width": 400, "height": 300})
        blocked = []
        page.on("console", lambda message: blocked.append(message.text))
        foreign = (f"websocket=ws://127.0.0.1:{port}", f"playbackPath=http://127.0.0.1:{port}/x")
        for one in foreign:
            blocked.clear()
            page.goto(f"{scene}&{one}")
            assert waited(page, lambda: any(str(port) in text for text in blocked))
        page.goto("&".join((session.address, *foreign)))
        assert waited(page, lambda: SCENES in page.frame("scene").url)
        assert str(port) not in page.frame("scene").url
        assert calls == []
        page.close()


def test_the_page_runs_no_planted_script_and_reaches_no_server_but_its_own(page):
    runs_no_planted_script(page)
    for reach in (
        "fetch('http://127.0.0.1:{}/').catch(() => 0)",
        "new WebSocket('ws://127.0.0.1:{}/')",
        "new Image().src = 'http://127.0.0.1:{}/'",
    ):
        is_out_of_reach(page, reach)


def is_out_of_reach(page, reach):
    with stranger() as (port, calls):
        script = """act => new Promise(done => {
            const heard = e => done(e.blockedURI);
            document.addEventListener('securitypolicyviolation', heard, {once: true});
            setTimeout(() => done('allowed'), 3000);
            act() })"""
        blocked = page.evaluate(
            f"() => ({script})(() => {{ try {{ {reach.format(port)} }} catch {{}} }})"
        )
        assert str(port) in blocked
        assert calls == []


def runs_no_planted_script(page):
    script = """planted => new Promise(done => {
        const e = document.createElement('div');
        document.body.append(e);
        e.innerHTML = planted;
        const s = document.createElement('script');
        s.textContent = "document.title='foreign'";
        e.append(s);
        const image = e.querySelector('img');
        if (image) image.addEventListener('error', done); // after the planted handler
        else done();
        e.remove() })"""
    assert page.title() == "race"
    for planted in ("<img src=x onerror=\"document.title='foreign'\">", "<script>/**/</script>"):
        page.evaluate(script, planted)
        assert page.title() == "race"


def test_no_frame_holds_the_page(browser, session):
    page = browser.new_page()
    page.goto("data:text/html,<title>around</title>")
    script = """address => {
        const frame = document.createElement('iframe');
        frame.src = address;
        document.body.append(frame) }"""
    for address in (session.address, session.address.replace("/?", f"{SCENE}?")):
        page.evaluate(script, address)
        assert waited(page, lambda: page.frames[-1].url.startswith("chrome-error"))
    page.close()
