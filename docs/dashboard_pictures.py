"""Take the pictures of dashboard.md: `.venv/bin/python docs/dashboard_pictures.py [FOLDER]`.

It flies and drives a chromium without a window, as tests/web/browser does, for some minutes. A
FOLDER keeps the flights for another time.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Frame, Page, ViewportSize, sync_playwright

from quadsim.racing.hand import HAND
from quadsim.record.archive import list_runs
from quadsim.web.choices import PILOT, Choices
from quadsim.web.menu import Menu
from quadsim.web.page.dashboard import Dashboard
from quadsim.web.page.server import address, serve
from quadsim.web.race import PageRace
from quadsim.web.session import Session

OUT = Path(__file__).parent
HOST = "127.0.0.1"
# drawn in software
DRAWN = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
WIDE = ViewportSize(width=1600, height=900)
PHONE = ViewportSize(width=390, height=844)
COLUMNS = 4  # of the sheet of the phone's pictures
SPACE = 10  # between its pictures [px]
COLOURS = 256  # of a picture's palette, which makes it a third as large
PATIENCE = 600.0  # [s] for a flight or a page
SETTLED = 4000  # [ms] until all is drawn
COLORED = Choices()
GAUSSIAN = Choices(sampler="gaussian")
CARELESS = Choices(settings={"samples": 256, "margin": 0.0, "crash": 0.0, "clearance": 0.0})
STORED = {"colored": COLORED, "gaussian": GAUSSIAN, "crashed": CARELESS}
# [s] of a race when the next gate is in the view of the drone's camera, and of its sensor
IN_VIEW = 7.5
SENSED = 0.5
RAISED = 1500  # [ms] of rising after a person has taken off
CLOSE_NOTICES = """document.querySelectorAll('button[class*=CloseButton], .notes button')
    .forEach(note => note.click())"""


class Studio:
    """A dashboard, a wide page and a phone's on it."""

    def __init__(self, browser: Browser, session: Session, dashboard: Dashboard, url: str):
        self.session = session
        self._browser = browser
        self._url = url
        self.page = self.open_page()
        self.phone = self.open_page(PHONE)
        self._dashboard = dashboard
        self._phone_shots: list[Image.Image] = []

    def open_page(self, size: ViewportSize = WIDE) -> Page:
        """Return a page of a visitor of its own."""
        page = self._browser.new_context(viewport=size).new_page()
        page.set_default_timeout(1e3 * PATIENCE)
        page.goto(self._url)
        page.locator("iframe[src]").wait_for()
        scene(page).get_by_text("Course editor").first.wait_for()
        return page

    def show(self, runs: Sequence[Path], t: float) -> None:
        """Show stored runs at t [s]."""
        races = self.session.snapshot.race
        self.session.tell(PageRace.start, [], runs)
        wait(lambda: self.session.snapshot.race > races)
        self.session.tell(PageRace.play, False)
        self.session.tell(PageRace.scrub, t)

    def next_camera(self, times: int = 1) -> None:
        """Choose the next camera of free, chase, top, FPV."""
        for page in (self.page, self.phone):
            for _ in range(times):
                page.keyboard.press("c")

    def shoot(self, name: str) -> None:
        """Take a picture once all has been drawn."""
        for page in (self.page, self.phone):
            close_notices(page)
            page.wait_for_timeout(SETTLED)
        save(picture_of(self.page), name)
        self._phone_shots.append(picture_of(self.phone))

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


def scene(page: Page) -> Frame:
    """Return the frame of the scene and of the settings."""
    found = page.frame("scene")
    assert found
    return found


def close_notices(page: Page) -> None:
    """Close the notices of the page and of its frame."""
    for part in (page, scene(page)):
        part.evaluate(CLOSE_NOTICES)


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
    """Fly to this time [s] or to the end, and pause."""
    races = session.snapshot.race
    session.tell(PageRace.start, choices)
    wait(lambda: session.snapshot.race > races)
    wait(lambda: session.snapshot.t >= until or not session.snapshot.flying)
    session.tell(PageRace.play, False)


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
    inside = scene(page)
    inside.get_by_text("Race", exact=True).click()
    folder = inside.get_by_role("button", name="Course editor", exact=True)
    folder.click()
    inside.get_by_role("button", name="Edit a copy").click()
    inside.get_by_role("button", name="Done", exact=True).wait_for()
    inside.get_by_role("button", name="later", exact=True).wait_for()
    inside.get_by_role("button", name="pole", exact=True).click()
    page.get_by_text("1 obstacle, ").first.wait_for()
    folder.scroll_into_view_if_needed()


def by_hand(studio: Studio, page: Page) -> None:
    """Take off by the keyboard, beside a planner."""
    session = studio.session
    page.wait_for_timeout(SETTLED)
    close_notices(page)
    show_settings(page, False)
    races = session.snapshot.race
    session.tell(PageRace.start, [Choices(sampler=HAND), COLORED])
    wait(lambda: session.snapshot.race > races)
    page.get_by_role("button", name="Take the sticks").click()
    # until then the keys are those of the page
    page.get_by_role("button", name="Let go (Esc)").wait_for()
    page.keyboard.down("s")
    page.wait_for_timeout(RAISED)
    page.keyboard.up("s")
    page.keyboard.down("w")
    wait(lambda: not session.snapshot.waiting)
    page.wait_for_timeout(RAISED)
    page.keyboard.up("w")
    save(picture_of(page), "hand")
    session.tell(PageRace.end_flights)


def take_pictures(studio: Studio, colored: Path, gaussian: Path, crashed: Path) -> None:
    """Take every picture."""
    session = studio.session
    studio.shoot("start")
    show_settings(studio.page, False)
    fly(session, COLORED, until=2.8)
    studio.shoot("live")
    fly(session, COLORED, GAUSSIAN, until=2.5)
    studio.shoot("ghost")
    fly(session, Choices(sampler=f"{PILOT}split_s_swift", sensing="gates"), until=SENSED)
    studio.next_camera()  # chase
    studio.shoot("estimate")
    session.tell(PageRace.end_flights)
    studio.next_camera(2)
    studio.show([colored], IN_VIEW)
    studio.shoot("fpv")
    studio.next_camera()
    studio.show([crashed], inf)
    studio.shoot("crash")
    studio.show([colored], inf)
    studio.shoot("finish")
    studio.show([colored, gaussian], 8.0)
    studio.page.wait_for_timeout(SETTLED)  # or the pointer is over a chart of the last race
    studio.page.locator(".race-chart canvas").first.hover(position={"x": 200, "y": 40})
    studio.shoot("replay")
    studio.save_phone()
    studio.page.keyboard.press("p")
    studio.page.wait_for_timeout(SETTLED)
    save(picture_of(studio.page), "present")
    studio.page.keyboard.press("p")
    studio.page.keyboard.press("t")
    studio.page.wait_for_timeout(SETTLED)
    save(picture_of(studio.page), "runs")
    studio.page.keyboard.press("Escape")
    edit(studio.page)
    studio.page.wait_for_timeout(SETTLED)
    close_notices(studio.page)
    save(picture_of(studio.page), "editor")
    studio.page.close()
    by_hand(studio, studio.open_page())


def main() -> None:
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
        studio = Studio(browser, session, dashboard, address(HOST, server.get_port()))
        take_pictures(studio, *runs)
        browser.close()
        dashboard.close()
        session.close()
        server.stop()


if __name__ == "__main__":
    main()
