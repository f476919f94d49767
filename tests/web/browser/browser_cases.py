"""A page in a real browser: its controls by their labels, as a person finds them."""

import re
from contextlib import contextmanager

from web.flight_factory import PILOT, Choices

SLOW = 60_000  # [ms] a first frame drawn in software


@contextmanager
def dashboard(root, flight_factory, **first):
    """A running page: its session, which knows its address."""
    from web.page.dashboard import Dashboard
    from web.page.guard import serve
    from web.page.race_panel import Menu
    from web.session import Session

    server = serve("127.0.0.1", 0, None, "race")
    session = Session(flight_factory, str(root))
    samplers = ("colored", "gaussian", f"{PILOT}split_s_swift")
    menu = Menu(
        ("split_s_swift", "figure8"), ("swift",), {"race": "swift"}, samplers, ("perfect", "gates")
    )
    page = Dashboard(server, session, flight_factory, menu, Choices(**first))
    session.server, session.address = server, f"http://127.0.0.1:{server.get_port()}/?fixedDpr=0.4"
    yield session
    page.close()
    session.close()
    server.stop()


def field(page, label):
    """The inputs of a control."""
    label = page.locator("label").filter(has_text=re.compile(f"^{re.escape(label)}$"))
    return label.locator("xpath=ancestor::div[contains(@class,'Flex-root')][1]").locator(
        "input:not([type=hidden])"
    )


def choose(page, label, option):
    field(page, label).click()
    page.get_by_role("option", name=option, exact=True).click()


def fill(page, label, value):
    field(page, label).last.fill(str(value))
    field(page, label).last.press("Enter")


def press(page, name):
    page.get_by_role("button", name=name, exact=True).click()


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


def listen(page):
    """Collect what the page complains of, in page.complaints: errors and warnings of its console,
    errors of scripts."""
    page.complaints = complaints = []

    def heard(message):
        # of a picture taken of what is drawn in software
        slow = "GPU stall due to ReadPixels" in message.text
        if message.type in ("error", "warning") and not slow:
            complaints.append(message.text)

    page.on("console", heard)
    page.on("pageerror", lambda error: complaints.append(str(error)))


def drone(page, k=0):
    """Where the page draws a drone [m]."""
    script = """name => { const n = window.__viserMutable?.nodeRefFromName[name];
                return n ? [n.position.x, n.position.y, n.position.z] : null }"""
    return page.evaluate(script, f"/competitor/{k}")
