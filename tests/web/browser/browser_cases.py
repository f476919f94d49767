"""A page in a real browser: its controls by their labels, as a person finds them."""

import re
from contextlib import contextmanager

from web_cases import served

from quadsim.racing.hand import HAND
from quadsim.web.state.choices import PILOT, Choices
from quadsim.web.state.menu import Menu

HELD = 1e-6  # speed of a flight that is held while a page is looked at [race seconds per second]
SLOW = 120_000  # [ms] a first frame drawn in software, on a busy machine
WIDE = {"width": 1200, "height": 800}
# The 3D scene is drawn in software, so it gets fewer pixels than the screen has ...
DRAWN = "?fixedDpr=0.2"
# ... and at most 5 pictures a second. Else drawing a flight takes a whole core.
FEWER_PICTURES = """() => {
    if (window === window.top) return; // the page itself draws little
    const draw = window.requestAnimationFrame.bind(window);
    const PAUSE = 200; // [ms]
    const pending = new Set();
    window.requestAnimationFrame = (callback) => {
        const frame = setTimeout(() => draw((t) => pending.delete(frame) && callback(t)), PAUSE);
        pending.add(frame);
        return frame;
    };
    window.cancelAnimationFrame = (frame) => pending.delete(frame);
}"""


@contextmanager
def dashboard(root, take_off, **first):
    """A running page: its session, which knows its address."""
    menu = Menu(
        courses=tuple(dict.fromkeys(("split_s_swift", "figure8", first.get("course", "figure8")))),
        vehicles=("swift", "paper"),
        presets=("race", "paper"),
        samplers=("colored", "gaussian", HAND, f"{PILOT}split_s_swift"),
        sensings=("perfect", "gates"),
    )
    with served(root, take_off, menu, Choices(**first)) as page:
        session = page.session
        session.server = page.server
        session.camera_modes = page.dashboard.camera._modes.values
        session.address = f"http://127.0.0.1:{page.port}/{DRAWN}"
        yield session


@contextmanager
def opened(browser, address, viewport=None):
    """A visitor's page, with what its console complains of in page.complaints."""
    with browser.new_context(viewport=viewport or WIDE, accept_downloads=True) as context:
        page = context.new_page()
        page.set_default_timeout(SLOW)
        page.add_init_script(f"({FEWER_PICTURES})()")
        listen(page)
        page.goto(address)
        drawer(page).get_by_label("Seed", exact=True).wait_for()
        yield page


def scene(page):
    """The frame of the scene."""
    assert waited(page, lambda: "/scene/" in page.frame("scene").url)
    return page.frame("scene")


def drawer(page):
    """The settings, in sight."""
    toggle = page.locator("[data-act=settings]")
    if toggle.get_attribute("aria-expanded") != "true":
        toggle.click()
    return page.locator(".drawer")


def group(page, title):
    """An open group of the settings."""
    found = (
        drawer(page)
        .locator("details")
        .filter(has=page.locator("> summary", has_text=re.compile(f"^{re.escape(title)}$")))
    )
    if found.last.get_attribute("open") is None:
        found.last.locator("> summary").click()
    return found.last


def field(page, label):
    """The box, choice or tick of a field; a label may lack its unit."""
    wanted = re.compile(rf"^{re.escape(label)}( \[.*\])?$")
    found = drawer(page).locator(".field").filter(has=page.locator("label", has_text=wanted))
    return found.locator("select, input:not([type=range])")


def choose(page, label, option):
    """Choose an option of a field."""
    field(page, label).select_option(option)


def fill(page, label, value):
    """Type a value once the field can be changed: a number in flight can soon after START."""
    assert waited(page, lambda: field(page, label).is_enabled())
    box = field(page, label)
    box.fill(str(value))
    box.press("Enter")


def error_of(page, label):
    """Return the error that the page shows beside a field."""
    wanted = re.compile(rf"^{re.escape(label)}( \[.*\])?$")
    found = drawer(page).locator(".field").filter(has=page.locator("label", has_text=wanted))
    return found.locator(".error").inner_text()


def add_rival(page, sampler):
    """Add a competitor, a copy of the one that is edited, with another sampler."""
    add(page)
    choose(page, "Sampler", sampler)


def add(page):
    """Add a competitor and wait until it is the one that is edited."""
    count = rows(page).count()
    press(page, "add")
    assert waited(page, lambda: rows(page).count() == count + 1)
    assert waited(page, lambda: rows(page).last.get_attribute("aria-pressed") == "true")


def alone(page):
    """Leave one competitor, with the preset's numbers for colored sampling."""
    while button(page, "remove").count():
        before = rows(page).count()
        press(page, "remove")
        assert waited(page, lambda n=before: rows(page).count() == n - 1)
    choose(page, "Sampler", "colored")
    press(page, "Reset to preset")
    assert waited(page, lambda: rows(page).count() == 1)
    assert waited(page, lambda: "colored" in rows(page).inner_text())


def rows(page):
    """The rows of the table of competitors."""
    return drawer(page).locator("[data-row]")


def button(page, name):
    """A button of the page, or else of its settings."""
    named = re.compile(f"^{re.escape(name)}$")
    found = page.locator("button:not([data-row]):visible").filter(has_text=named)
    over = page.locator(".race-sheet:visible, dialog[open]")
    if found.count() or over.count():
        return found
    return drawer(page).locator("button:not([data-row]):visible").filter(has_text=named)


def press(page, name):
    assert waited(page, lambda: button(page, name).count() > 0), name
    button(page, name).click()


def head(page):
    """What the head of the page says."""
    return page.locator(".head .said").inner_text()


def shown_time(page):
    """The time of the race that this visitor watches [s]."""
    return float(page.get_by_label("Time [s]").input_value() or "nan")


def is_playing(page):
    """Whether the time that this visitor watches goes on."""
    return page.locator("[data-act=play]").inner_text() == "pause"


def type_time(page, t):
    """Watch another time, and pause there."""
    box = page.get_by_label("Time [s]")
    box.fill(str(t))
    box.press("Enter")


def waited(page, claim, seconds=90):
    """Return whether the claim comes true while the browser lives on.

    A scene is asked again if it is opened anew meanwhile, as it is after an outage.
    """
    for _ in range(int(seconds / 0.05)):
        try:
            if claim():
                return True
        except Exception as error:
            if "Execution context was destroyed" not in str(error):
                raise
        page.wait_for_timeout(50)
    return False


def listen(page):
    """Collect errors and warnings of the console and errors of scripts.

    Left out are a stall and a missing extension of software drawing, advice of three.js to viser,
    and viser's sorter of Gaussian splats, of which this page has none: the policy forbids its code.
    """
    page.complaints = complaints = []
    unimportant = (
        "GPU stall due to ReadPixels",
        "KHR_parallel_shader_compile",
        "THREE.Clock",
        "unsafe-eval",
        "EvalError",
    )

    def heard(kind, text):
        if kind in ("error", "warning") and not any(part in text for part in unimportant):
            complaints.append(text)

    page.on("console", lambda message: heard(message.type, message.text))
    page.on("pageerror", lambda error: heard("error", str(error)))


def drone(frame, k=0):
    """Return where a frame of viser's draws a drone [m]."""
    script = """name => { const n = window.__viserMutable?.nodeRefFromName[name];
                return n ? [n.position.x, n.position.y, n.position.z] : null }"""
    return frame.evaluate(script, f"/competitor/{k}")
