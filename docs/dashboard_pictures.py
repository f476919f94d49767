"""Take the pictures of dashboard.md: `.venv/bin/python docs/dashboard_pictures.py [FOLDER]`.

It flies and drives a chromium without a window, as tests/web/browser does, for some minutes. A
FOLDER keeps the flights for another time. Flights and browser take turns: a scene that is drawn in
software takes the cores that a planner needs.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import inf
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright
from websockets.sync.client import connect

from quadsim.racing.hand import HAND
from quadsim.record.archive import list_runs
from quadsim.web.page.dashboard import Dashboard
from quadsim.web.page.server.page_server import address, serve
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.session import Session
from quadsim.web.state.choices import PILOT, Choices
from quadsim.web.state.menu import Menu

OUT = Path(__file__).parent
HOST = "127.0.0.1"
# drawn in software
DRAWN = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# at most 5 pictures a second; else drawing takes a whole core
FEWER_PICTURES = """(() => {
    const draw = window.requestAnimationFrame.bind(window);
    window.requestAnimationFrame = callback => setTimeout(() => draw(callback), 200);
    window.cancelAnimationFrame = clearTimeout;
})()"""
WIDE = ViewportSize(width=1600, height=900)
PHONE = ViewportSize(width=390, height=844)
COLUMNS = 4  # of the sheet of the phone's pictures
SPACE = 10  # between its pictures [px]
COLOURS = 256  # of a picture's palette, which makes it a third as large
PATIENCE = 120.0  # [s] for a flight or a page
SETTLED = 5000  # [ms] until all is drawn
COLORED = Choices()
GAUSSIAN = Choices(sampler="gaussian")
CARELESS = Choices(settings={"samples": 256, "margin": 0.0, "crash": 0.0, "clearance": 0.0})
STORED = {"colored": COLORED, "gaussian": GAUSSIAN, "crashed": CARELESS}
# [s] of a race when the next gate is in the view of the drone's camera, and of its sensor
IN_VIEW = 7.5
SENSED = 0.5
FAR = 1e5  # a time after the end of any race [s]
HELD = 1e-6  # speed of a flight that is held [race seconds per second]
SLOW = 0.1  # speed of a flight while a page that watches live is drawn
LOWERED = 1500  # [ms] for which the throttle is lowered before a flight by hand
RAISED = 820  # [ms] for which it is raised then, to a little more than in hover
RISEN = 1.0  # time of that flight at which its picture is taken [s]
CLOSE_NOTICES = "document.querySelectorAll('.notes button').forEach(note => note.click())"


class Studio:
    """Takes pictures of a dashboard, on a wide screen and on a phone's."""

    def __init__(self, browser: Browser, session: Session, url: str):
        self.session = session
        self._browser = browser
        self._url = url
        self._phone_shots: list[Image.Image] = []
        self._t = inf  # time that visitors watch [s]; beyond the end: the end

    @contextmanager
    def page(
        self, size: ViewportSize = WIDE, camera: str = "free", live: bool = False
    ) -> Iterator[Page]:
        """A page of a visitor of its own, once its scene has been drawn, live or at one time."""
        with self._browser.new_context(viewport=size) as context:
            page = context.new_page()
            page.set_default_timeout(1e3 * PATIENCE)
            page.add_init_script(FEWER_PICTURES)
            page.goto(self._url)
            page.locator('[data-camera="free"][aria-pressed=true]').wait_for()
            box = page.get_by_label("Time [s]")
            if box.is_enabled() and not live:
                box.fill(str(min(self._t, FAR)))
                box.press("Enter")
            if camera != "free":
                page.get_by_role("button", name=camera, exact=True).click()
            page.wait_for_timeout(SETTLED)
            yield page

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Watch the race without a browser, so that sampled trajectories are kept."""
        with connect(self._url.replace("http", "ws") + "link"):
            yield

    def shoot(
        self, name: str, camera: str = "free", settings: bool = False, live: bool = False
    ) -> None:
        """Take a picture on both screens."""
        print(name, flush=True)
        with self.page(camera=camera, live=live) as page:
            show_settings(page, settings)
            page.evaluate(CLOSE_NOTICES)
            page.wait_for_timeout(SETTLED)
            save(picture_of(page), name)
        with self.page(PHONE, camera, live) as page:
            page.evaluate(CLOSE_NOTICES)
            self._phone_shots.append(picture_of(page))

    def show(self, runs: Sequence[Path], t: float) -> None:
        """Show stored runs at t [s]."""
        races = self.session.snapshot.race
        self._t = t
        self.session.tell(PageRace.start, [], runs)
        wait(lambda: self.session.snapshot.race > races)

    def fly(self, *choices: Choices, until: float) -> None:
        """Fly to this time [s], and hold the flight there."""
        self._t = inf
        with self.watched():
            fly(self.session, *choices, until=until)

    def save_phone(self) -> None:
        """Save a sheet of all that the phone has shown."""
        width = PHONE["width"] + SPACE
        height = PHONE["height"] + SPACE
        rows = -(-len(self._phone_shots) // COLUMNS)
        size = (COLUMNS * width - SPACE, rows * height - SPACE)
        sheet = Image.new("RGB", size, "white")
        for k, shot in enumerate(self._phone_shots):
            row, column = divmod(k, COLUMNS)
            sheet.paste(shot, (column * width, row * height))
        save(sheet, "phone")


def show_settings(page: Page, on: bool) -> None:
    """Open or close the settings."""
    button = page.get_by_role("button", name="Settings", exact=True)
    if (button.get_attribute("aria-expanded") == "true") != on:
        button.click()


def picture_of(page: Page) -> Image.Image:
    """Return a screenshot."""
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def save(image: Image.Image, name: str) -> None:
    """Save a picture of dashboard.md."""
    small = image.quantize(COLOURS, dither=Image.Dither.NONE)
    small.save(OUT / f"dashboard_{name}.png", optimize=True)


def wait(claim: Callable[[], bool]) -> None:
    """Wait until it comes true."""
    end = time.monotonic() + PATIENCE
    while not claim():
        if time.monotonic() > end:
            raise TimeoutError(f"nothing after {PATIENCE:g} s")
        time.sleep(0.02)


def fly(session: Session, *choices: Choices, until: float = inf) -> None:
    """Fly to this time [s] or to the end, and hold the flight there."""
    session.tell(PageRace.set_speed, 1.0)
    races = session.snapshot.race
    session.tell(PageRace.start, choices)
    wait(lambda: session.snapshot.race > races)
    wait(lambda: session.snapshot.t >= until or not session.snapshot.flying)
    session.tell(PageRace.set_speed, HELD)


def stored(root: Path, choices: Choices) -> Path:
    """Return a run of these choices, flown while no page is open, unless it lies there."""
    runs = list_runs(root)
    if runs:
        return runs[-1]
    session = Session(str(root))
    fly(session, choices)
    (flown,) = session.snapshot.competitors
    session.close()
    assert flown.folder
    return flown.folder


def edit(page: Page) -> None:
    """Edit a copy of the chosen course: another gate is chosen, and a pole stands beside it."""
    show_settings(page, True)
    group = page.locator(".drawer summary", has_text="Course editor")
    group.click()
    page.get_by_role("button", name="Edit a copy").click()
    page.get_by_role("button", name="later", exact=True).wait_for()
    page.get_by_role("button", name="add pole", exact=True).click()
    page.get_by_text("1 obstacle, ").first.wait_for()
    group.evaluate("group => group.scrollIntoView()")
    page.wait_for_timeout(SETTLED)


def by_hand(session: Session, page: Page) -> None:
    """Take off by the keyboard, beside a planner."""
    show_settings(page, False)
    races = session.snapshot.race
    session.tell(PageRace.set_speed, 1.0)
    session.tell(PageRace.start, [Choices(sampler=HAND), COLORED])
    wait(lambda: session.snapshot.race > races)
    page.get_by_role("button", name="Take the sticks").click()
    # until then the keys are those of the page
    page.get_by_role("button", name="Let go (Esc)").wait_for()
    page.keyboard.down("s")
    page.wait_for_timeout(LOWERED)
    page.keyboard.up("s")
    page.keyboard.down("w")
    page.wait_for_timeout(RAISED)
    page.keyboard.up("w")
    wait(lambda: session.snapshot.t > RISEN)
    save(picture_of(page), "hand")
    session.tell(PageRace.end_flights)


def take_pictures(studio: Studio, colored: Path, gaussian: Path, crashed: Path) -> None:
    """Take every picture."""
    session = studio.session
    studio.shoot("start", settings=True)
    studio.fly(COLORED, until=2.8)
    session.tell(PageRace.set_speed, SLOW)
    studio.shoot("live", live=True)
    studio.fly(COLORED, GAUSSIAN, until=2.5)
    studio.shoot("ghost")
    studio.fly(Choices(sampler=f"{PILOT}split_s_swift", sensing="gates"), until=SENSED)
    studio.shoot("estimate", "chase")
    session.tell(PageRace.end_flights)
    studio.show([colored], IN_VIEW)
    studio.shoot("fpv", "FPV")
    studio.show([crashed], inf)
    studio.shoot("crash")
    studio.show([colored], inf)
    studio.shoot("finish")
    studio.show([colored, gaussian], 8.0)
    studio.shoot("replay")
    studio.save_phone()
    with studio.page() as page:
        show_settings(page, False)
        page.locator(".race-chart canvas").first.hover(position={"x": 200, "y": 40})
        page.wait_for_timeout(SETTLED)
        save(picture_of(page), "replay")
        page.keyboard.press("p")
        page.wait_for_timeout(SETTLED)
        save(picture_of(page), "present")
        page.keyboard.press("p")
        page.keyboard.press("t")
        page.wait_for_timeout(SETTLED)
        save(picture_of(page), "runs")
    with studio.page() as page:
        edit(page)
        save(picture_of(page), "editor")
    with studio.page() as page:
        by_hand(session, page)


def main() -> None:
    """Fly, and take every picture."""
    with tempfile.TemporaryDirectory() as root, sync_playwright() as p:
        kept = Path(sys.argv[1] if sys.argv[1:] else root)
        flown = [stored(kept / name, choices) for name, choices in STORED.items()]
        runs = [Path(shutil.copytree(run, Path(root) / "runs" / run.name)) for run in flown]
        server = serve(HOST, 0, None, "race")
        session = Session(f"{root}/runs")
        menu = Menu.of_everything(COLORED.course)
        dashboard = Dashboard(server, session, menu, COLORED, GAUSSIAN)
        found = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = p.chromium.launch(executable_path=found, args=DRAWN)
        take_pictures(Studio(browser, session, address(HOST, server.get_port())), *runs)
        browser.close()
        dashboard.close()
        session.close()
        server.stop()


if __name__ == "__main__":
    main()
