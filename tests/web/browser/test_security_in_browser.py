"""Claims that a link or a foreign page cannot make the page talk to another server or run a foreign
script."""

import socket
import threading
from contextlib import contextmanager

import pytest
from browser_cases import dashboard, waited
from web_cases import COURSE, Gliders


@pytest.fixture(scope="module")
def session(root):
    with dashboard(root, Gliders(), course=COURSE, laps=1) as session:
        yield session


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


def test_a_link_cannot_send_the_page_to_another_server_or_make_it_play_a_foreign_recording(
    browser, session
):
    """All in one link: whichever was left in the address would call the stranger."""
    foreign = (
        "websocket=ws://127.0.0.1:{}",
        "%77ebsocket=ws://127.0.0.1:{}",
        "playbackPath=http://127.0.0.1:{}/x.viser",
    )
    with stranger() as (port, calls):
        page = browser.new_page(viewport={"width": 400, "height": 300})
        page.goto("&".join([session.address, *(what.format(port) for what in foreign)]))
        page.get_by_role("button", name="START", exact=True).wait_for()
        assert calls == []
        assert "ebsocket" not in page.url
        assert "playbackPath" not in page.url
        page.close()


@pytest.mark.parametrize(
    "reach",
    [
        "fetch('http://127.0.0.1:{}/')",
        "new WebSocket('ws://127.0.0.1:{}/')",
        "new Image().src = 'http://127.0.0.1:{}/'",
    ],
)
def test_the_page_reaches_no_server_but_its_own(page, reach):
    with stranger() as (port, calls):
        script = """act => new Promise(done => {
            document.addEventListener('securitypolicyviolation', e => done(e.blockedURI), {once: true});
            setTimeout(() => done('allowed'), 3000); act() })"""
        blocked = page.evaluate(
            f"() => ({script})(() => {{ try {{ {reach.format(port)} }} catch {{}} }})"
        )
        assert str(port) in blocked
        assert calls == []


@pytest.mark.parametrize(
    "planted", ["<img src=x onerror=\"document.title='foreign'\">", "<script>/**/</script>"]
)
def test_a_planted_script_does_not_run(page, planted):
    script = """planted => { const e = document.createElement('div'); document.body.append(e); e.innerHTML = planted;
        const s = document.createElement('script'); s.textContent = "document.title='foreign'"; e.append(s) }"""
    assert page.title() == "race"
    page.evaluate(script, planted)
    page.wait_for_timeout(500)
    assert page.title() == "race"


def test_no_frame_holds_the_page(browser, session):
    page = browser.new_page()
    page.goto("data:text/html,<title>around</title>")
    page.evaluate(
        "a => { const f = document.createElement('iframe'); f.src = a; document.body.append(f) }",
        session.address,
    )
    assert waited(
        page, lambda: len(page.frames) == 2 and page.frames[1].url.startswith("chrome-error"), 20
    )
    page.close()
