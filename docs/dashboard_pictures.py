"""The pictures of dashboard.md, in some minutes: `.venv/bin/python docs/dashboard_pictures.py
[FOLDER]`.

Flies, and drives a chromium without a window as tests/web/browser does. A FOLDER keeps the flights
for another time.
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
from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright

from controllers.learned.pilot import pilot_names
from controllers.presets import PRESETS
from controllers.samplers import SAMPLERS
from quadsim.course import course_names
from quadsim.record.archive import list_runs
from quadsim.sensing import sensing_names
from quadsim.vehicle import vehicle_names
from web.flight_factory import PILOT, Choices, FlightFactory
from web.page.dashboard import Dashboard
from web.page.guard import serve
from web.page.race_panel import Menu
from web.race import Race
from web.session import Session

OUT = Path(__file__).parent
# in software
DRAWN = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
WIDE, PHONE = ViewportSize(width=1600, height=900), ViewportSize(width=390, height=844)
COLUMNS = 4  # of the phone's sheet
COLOURS = 256  # of a picture's palette, which makes it a third as large
PATIENCE, SETTLED = 600.0, 4000  # [s] for a flight or a page, [ms] until all is drawn
COLORED, GAUSSIAN = Choices(), Choices(sampler="gaussian")
CARELESS = {"samples": 256, "margin": 0.0, "crash": 0.0, "clearance": 0.0}
STORED = {"colored": COLORED, "gaussian": GAUSSIAN, "crashed": Choices(settings=CARELESS)}
# [s] of a race when the next gate is in the view of the drone's camera, of its sensor
IN_VIEW, SENSED = 7.5, 0.5


class Studio:
    """A dashboard, a wide page and a phone's on it."""

    def __init__(self, browser: Browser, session: Session, dashboard: Dashboard, address: str):
        self.session, self._dashboard, self._phone_shots = session, dashboard, []
        self.page, self.phone = (open_page(browser, address, size) for size in (WIDE, PHONE))

    def show(self, runs: Sequence[Path], t: float) -> None:
        """Of stored runs."""
        races = self.session.snapshot.race
        self._dashboard.race.show_replay(runs)
        self.session.tell(Race.start, [], runs)
        wait(lambda: self.session.snapshot.race > races)
        self.session.tell(Race.play, False)
        self.session.tell(Race.scrub, t)

    def next_camera(self, times: int = 1) -> None:
        """Of free, chase, top, FPV."""
        for page in (self.page, self.phone):
            for _ in range(times):
                page.keyboard.press("c")

    def shoot(self, name: str) -> None:
        """Once all has been drawn."""
        for page in (self.page, self.phone):
            page.evaluate(
                "document.querySelectorAll('button[class*=CloseButton]').forEach(note => note.click())"
            )
            page.wait_for_timeout(SETTLED)
        save(picture_of(self.page), name)
        self._phone_shots.append(picture_of(self.phone))

    def save_phone(self) -> None:
        """The sheet of all that the phone has shown."""
        width, height, rows = (
            PHONE["width"] + 10,
            PHONE["height"] + 10,
            -(-len(self._phone_shots) // COLUMNS),
        )
        sheet = Image.new("RGB", (COLUMNS * width - 10, rows * height - 10), "white")
        for k, shot in enumerate(self._phone_shots):
            sheet.paste(shot, (k % COLUMNS * width, k // COLUMNS * height))
        save(sheet, "phone")


def open_page(browser: Browser, address: str, size: ViewportSize) -> Page:
    page = browser.new_context(viewport=size).new_page()
    page.set_default_timeout(1e3 * PATIENCE)
    page.goto(address)
    page.get_by_role("button", name="START", exact=True).wait_for()
    return page


def picture_of(page: Page) -> Image.Image:
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def save(image: Image.Image, name: str) -> None:
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(
        OUT / f"dashboard_{name}.png", optimize=True
    )


def wait(claim: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not claim():
        if time.monotonic() > end:
            raise TimeoutError(f"nothing after {PATIENCE:g} s")
        time.sleep(0.02)


def fly(session: Session, *choices: Choices, until: float = inf) -> None:
    """To this time [s] or to the end; then it is paused."""
    races = session.snapshot.race
    session.tell(Race.start, choices)
    wait(lambda: session.snapshot.race > races)
    wait(lambda: session.snapshot.t >= until or not session.snapshot.flying)
    session.tell(Race.play, False)


def stored(root: Path, choices: Choices) -> Path:
    """A run of these, flown while no page is open, unless it lies there."""
    if runs := list_runs(root):
        return runs[-1]
    session = Session(FlightFactory(), str(root))
    fly(session, choices)
    (flown,) = session.snapshot.competitors
    session.close()
    assert flown.folder
    return flown.folder


def take_pictures(studio: Studio, colored: Path, gaussian: Path, crashed: Path) -> None:
    session = studio.session
    studio.shoot("start")
    fly(session, COLORED, until=2.8)
    studio.shoot("live")
    fly(session, COLORED, GAUSSIAN, until=2.5)
    studio.shoot("ghost")
    fly(session, Choices(sampler=f"{PILOT}split_s_swift", sensing="gates"), until=SENSED)
    studio.next_camera()  # chase
    studio.shoot("estimate")
    session.tell(Race.end_flights)
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
    studio.page.locator(".u-over").first.hover(position={"x": 200, "y": 40})
    studio.shoot("replay")
    studio.save_phone()


def main() -> None:
    samplers = (*SAMPLERS, *(PILOT + name for name in pilot_names()))
    presets = {name: planners["colored"].vehicle for name, planners in PRESETS.items()}
    menu = Menu(course_names(), vehicle_names(), presets, samplers, sensing_names())
    with tempfile.TemporaryDirectory() as root, sync_playwright() as p:
        kept = Path(sys.argv[1] if sys.argv[1:] else root)
        flown = [stored(kept / name, choices) for name, choices in STORED.items()]
        runs = [Path(shutil.copytree(run, Path(root) / "runs" / run.name)) for run in flown]
        server, session = (
            serve("127.0.0.1", 0, None, "race"),
            Session(FlightFactory(), f"{root}/runs"),
        )
        dashboard = Dashboard(server, session, FlightFactory(), menu, Choices())
        found = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = p.chromium.launch(executable_path=found, args=DRAWN)
        take_pictures(
            Studio(browser, session, dashboard, f"http://127.0.0.1:{server.get_port()}/"), *runs
        )
        browser.close()
        dashboard.close()
        session.close()
        server.stop()


if __name__ == "__main__":
    main()
